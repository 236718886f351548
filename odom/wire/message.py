"""One message, with the same bytes on Zenoh and in a recording."""

from dataclasses import dataclass

from odom.frame import Stamp


@dataclass(frozen=True)
class Message:
    """A ROS 2 message: `topic` is the Zenoh key and the ROS topic without its leading slash.

    `type_name` is the ROS type (`sensor_msgs/msg/Image`), `stamp` the capture time in its header (nanoseconds) and
    `payload` its CDR bytes, which begin with the 4-byte encapsulation header.
    """

    topic: str
    type_name: str
    stamp: Stamp
    payload: bytes

    def __repr__(self) -> str:
        return f"Message({self.topic}, {self.type_name}, {self.stamp}, {len(self.payload)} bytes)"
