"""What a key frame saw, as a small coloured cloud for eyes. Pure."""

from odom.frame import Camera, RgbdFrame
from odom.viewer.clouds import back_project
from odom.wire import Message, Topics, codec

_COLOR_WIDTH = 160


def keyframe_message(topics: Topics, frame: RgbdFrame, camera: Camera, color: Message, points: int) -> Message:
    """Return the cloud of a frame, at most about `points`, coloured by the image message that the frame was made of.

    Raises WireError when that cannot be decoded.
    """
    cloud = back_project(camera, codec.decode_color_small(color, _COLOR_WIDTH), frame.depth_mm, points)
    return codec.encode_cloud(topics.keyframes, frame.stamp, cloud.points, cloud.colors, topics.frame_camera)
