"""True poses in a recording: which topics hold them, and poses of any type as `truth/<body>/pose`."""

import logging
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path

from odom.errors import ConfigError, WireError
from odom.wire import Message, truth
from odom.wire.codec import cdr, decode_any_pose, encode_pose
from odom.wire.recording import RecordedStream

log = logging.getLogger(__name__)

TRUTH_ROLE = "truth"
"""What `--topic` calls the topic of true poses."""
_NO_BODY = ("pose", "odom", "odometry")
"""Last words of a topic that do not name the body."""
_TRUTH_WORDS = ("truth", "gt", "vicon", "mocap", "optitrack", "qualisys")
"""Words in names of topics that speak for true poses."""
_OWN = ("odom", "pose", "chain")
"""Poses that this project records beside the colour images from which it found them."""
_MOST_NAMED = 5
"""Topics that are named at most, so that the line can be read."""


def true_poses(streams: Iterable[RecordedStream], named: str | None) -> dict[str, str]:
    """Return topic to key of the true poses: those named truth/<body>/pose, or the one that is `named`.

    Raises ConfigError when that one is not there or holds something else than one body's pose a message.
    """
    types = {stream.topic: stream.type_name for stream in streams}
    if named is None:
        return {
            topic: truth(topic.removeprefix("truth/").removesuffix("/pose"))
            for topic, type_name in types.items()
            if type_name == cdr.POSE and topic.startswith("truth/")
        }
    topic = named.removeprefix("/")
    if types.get(topic) not in cdr.POSES:
        held = ", ".join(f"/{other} ({name})" for other, name in types.items() if name in cdr.POSES) or "none"
        raise ConfigError(f"--topic {TRUTH_ROLE}={named}: give one of the recording's poses; these are: {held}")
    body = [word for word in topic.split("/") if word not in _NO_BODY]
    return {topic: truth(body[-1] if body else "")}


def could_be_truth(streams: Iterable[RecordedStream], color_topic: str) -> str | None:
    """Return in words which poses of a recording without truth could be it, and the option; None where none could."""
    device = color_topic.partition("/color/")[0]
    own = {f"{device}/{name}" for name in _OWN}
    found = [stream for stream in streams if stream.type_name in cdr.POSES and stream.topic not in own]
    if not found:
        return None
    found.sort(key=lambda stream: (not any(word in stream.topic.lower() for word in _TRUTH_WORDS), stream.topic))
    listed = ", ".join(f"/{stream.topic} ({stream.type_name})" for stream in found[:_MOST_NAMED])
    return (
        f"no topic is taken for true poses; it holds poses on {listed}: if the truth is among them, give "
        f"--topic {TRUTH_ROLE}=/{found[0].topic}"
    )


class TruthReader:
    """Makes the poses of a recording's topics those of bodies; `left_out` counts by topic those that are none."""

    def __init__(self, keys: Mapping[str, str]) -> None:
        self._keys = keys
        self.left_out: dict[str, tuple[int, str]] = {}

    def __call__(self, message: Message) -> Message | None:
        """Return the message on its body's key, as geometry_msgs/PoseStamped; None where it holds no pose."""
        key = self._keys[message.topic]
        try:
            pose = decode_any_pose(message)
            if message.type_name == cdr.POSE:
                return replace(message, topic=key)
            return encode_pose(key, pose.stamp, pose.T_parent_child, pose.parent)
        except WireError as error:
            count, why = self.left_out.get(message.topic, (0, str(error)))
            self.left_out[message.topic] = count + 1, why
            return None

    def tell(self, path: Path) -> None:
        """Log what was left out."""
        for topic, (count, why) in self.left_out.items():
            log.warning("%s: %d poses of /%s are left out, such as: %s", path, count, topic, why)
