"""Which of a driver's topics are images and calibrations, with one form of each image."""

from odom.wire.codec.cdr import CAMERA_INFO, COMPRESSED_IMAGE, IMAGE
from odom.wire.ros2.names import Endpoint

_DEPTH_WORDS = ("depth", "disparity")
_COMPRESSED, _COMPRESSED_DEPTH = "/compressed", "/compressedDepth"


def image_topics(topics: dict[str, list[Endpoint]], compressed: bool) -> list[str]:
    """Return one topic for each image: the raw one, or with `compressed` the compressed one, where there are both.

    A driver offers each image in several forms and makes those that somebody subscribes to.
    """
    forms: dict[str, list[str]] = {}
    for topic, endpoints in topics.items():
        if endpoints[0].type_name == IMAGE:
            forms.setdefault(topic, []).append(topic)
        elif endpoints[0].type_name == COMPRESSED_IMAGE and topic.endswith((_COMPRESSED, _COMPRESSED_DEPTH)):
            forms.setdefault(topic.rpartition("/")[0], []).append(topic)
    return sorted(min(offered, key=lambda topic: _order(base, topic, compressed)) for base, offered in forms.items())


def info_topics(topics: dict[str, list[Endpoint]]) -> list[str]:
    """Return the topics of calibrations."""
    return [topic for topic, endpoints in topics.items() if endpoints[0].type_name == CAMERA_INFO]


def _order(base: str, topic: str, compressed: bool) -> tuple[bool, bool]:
    is_depth = any(word in base.lower() for word in _DEPTH_WORDS)
    fitting = base + (_COMPRESSED_DEPTH if is_depth else _COMPRESSED)
    return ((topic != base) != compressed, topic not in (base, fitting))
