"""What the names of topics say of the images on them: colour or not, depth or not, registered, of which device."""

from collections.abc import Iterable
from itertools import takewhile

_COLOR_WORDS, _OTHER_WORDS = ("color", "colour", "rgb"), ("ir", "infra", "depth", "thermal", "mask", "fisheye")
_DEPTH_WORDS, _INFRARED_WORDS = ("depth",), ("ir", "infra", "infrared")
_NOT_DEPTH_WORDS = (*_INFRARED_WORDS, "confidence", "disparity", "thermal", "mask", "amplitude", "intensity")
_REGISTERED_WORDS = ("aligned", "registered", "depth_to_color", "depth_to_rgb", "depth_to_colour")
"""Words that drivers put into the names of topics: for colour, for what is not colour, for depth, for infrared images
(which stand in for colour), for images of 16 bits that are no depth, for depth registered to colour."""


def says_color(topic: str) -> int:
    """Return 1 for a name that says colour, -1 for one that says something else, 0 for neither or both."""
    return _says(topic, _COLOR_WORDS) - says_other(topic)


def says_other(topic: str) -> bool:
    """Return whether a name says that its images are not of colour."""
    return _says(topic, _numbered(_OTHER_WORDS))


def says_depth(topic: str) -> int:
    """Return 1 for a name that says depth, -1 for one that says something else, 0 for neither or both."""
    return _says(topic, _DEPTH_WORDS) - _says(topic, _numbered(_NOT_DEPTH_WORDS))


def is_seen(topic: str) -> bool:
    """Return whether images in 16 bits of grey are by their name not depth, but what a camera sees, infrared too."""
    return _says(topic, _COLOR_WORDS) or (_says(topic, _numbered(_INFRARED_WORDS)) and not _says(topic, _DEPTH_WORDS))


def says_rectified(topic: str) -> bool:
    """Return whether a name says that the lens' distortion has been taken out of the images."""
    return _says(topic, ("rect", "rectified"))


def says_registered(topic: str) -> bool:
    """Return whether a topic's name says that it is depth's, registered to colour."""
    return any(word in topic.lower() for word in _REGISTERED_WORDS)


def shared_folders(topic: str, image: str) -> int:
    """Return how many parts of a topic's path, without its last one, are those of an image's."""
    own, other = topic.split("/")[:-1], image.split("/")
    return len(list(takewhile(lambda pair: pair[0] == pair[1], zip(own, other, strict=False))))


def _says(topic: str, words: Iterable[str]) -> bool:
    """Return whether one of the words is a word of the topic's name."""
    return not set(topic.lower().replace("/", "_").split("_")).isdisjoint(words)


def _numbered(words: Iterable[str]) -> list[str]:
    """Return the words as they are and with the numbers of a pair."""
    return [word + number for word in words for number in ("", "1", "2")]
