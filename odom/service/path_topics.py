"""The corrected path by parts: `<ns>/path` holds the one the camera is in, `<ns>/path/segment_N` each other one."""

from collections.abc import Iterator

from odom.backend import Estimate, TrajectoryPose
from odom.frame import Stamp
from odom.geometry.arrays import Array
from odom.wire import Message, Topics, codec

_MOST_PARTS = 32
"""Parts that are published beside the one the camera is in, those with most key frames: each has a key of its own,
which every viewer and router remembers. A camera in the dark may begin thousands a day, of one key frame each."""


class PathTopics:
    """Splits the key-frame path where its parts were never joined, and leaves out what has been sent already.

    A part that the camera is not in has a frame of its own (`map_segment_0`): where it lies in `map` is not known. When
    it is joined, or the camera is back in it, an empty path follows on its topic.
    """

    def __init__(self, topics: Topics) -> None:
        self._topics = topics
        self._path: tuple[TrajectoryPose, ...] = ()
        self._segment = 0
        self._apart: dict[str, bytes] = {}

    def messages(self, estimate: Estimate) -> Iterator[Message]:
        """Yield the paths that changed with an estimate, that of the part the camera is in last."""
        if estimate.path is None and estimate.segment == self._segment:
            return
        self._path = self._path if estimate.path is None else estimate.path
        self._segment = estimate.segment
        parts: dict[int, list[tuple[Stamp, Array]]] = {self._segment: []}
        for pose in self._path:
            if pose.T_map_camera is not None:
                parts.setdefault(pose.segment, []).append((pose.stamp, pose.T_map_camera))
        current = parts.pop(self._segment)
        largest = sorted(parts.items(), key=lambda part: (-len(part[1]), part[0]))[:_MOST_PARTS]
        apart = {f"{self._topics.path}/segment_{segment}": (segment, poses) for segment, poses in largest}
        for key, (segment, poses) in apart.items():
            frame = f"{self._topics.frame_map}_segment_{segment}"
            message = codec.encode_path(key, poses[-1][0], poses, frame)
            if self._apart.get(key) != message.payload:
                self._apart[key] = message.payload
                yield message
        for key in self._apart.keys() - apart.keys():
            del self._apart[key]
            yield codec.encode_path(key, estimate.stamp, (), self._topics.frame_map)
        yield codec.encode_path(self._topics.path, estimate.stamp, current, self._topics.frame_map)

    def holds(self, topic: str) -> bool:
        """Whether a topic of this module's messages still has a path."""
        return topic == self._topics.path or topic in self._apart
