"""Images of one folder that are named alike but for their numbers: of several cameras' only one's are a stream."""

import logging
import re
from collections.abc import Collection, Iterable
from pathlib import Path

from sensors.image_names import COLOR_WORDS, DEPTH_WORDS, alike

log = logging.getLogger(__name__)

_TIME_OR_NUMBER = re.compile(r"\d+(?:\.\d+)?")
_WORD = re.compile(r"[a-z]+")


def of_one_camera(color: Collection[Path], depth: Collection[Path]) -> tuple[list[Path], list[Path]]:
    """Return the images of colour and of depth that are of one camera each, by their names, of one if they say so.

    Their names differ in their numbers only; those without a number are left out. Of several kinds it is the one of
    most images; among those of half as many or more rather one that colour and depth have in common, but for the words
    for these; then the shortest name. What is left out is logged.
    """
    depth = _one_kind(depth, beside=color)
    return _one_kind(color, beside=depth), depth


def _one_kind(files: Iterable[Path], beside: Iterable[Path]) -> list[Path]:
    kinds, others = alike(files, _TIME_OR_NUMBER), {_words(name) for name in alike(beside, _TIME_OR_NUMBER)}
    if not kinds:
        return []
    many = max(map(len, kinds.values())) / 2
    first, *rest = sorted(
        kinds,
        key=lambda name: (len(kinds[name]) < many, _words(name) not in others, -len(kinds[name]), len(name), name),
    )
    taken = kinds[first]
    if left_out := [kinds[name] for name in rest]:
        log.warning(
            "%s: of its images, %d named as %s are taken and %d named otherwise left out, such as %s",
            taken[0].parent, len(taken), taken[0].name, sum(map(len, left_out)), left_out[0][0].name,
        )  # fmt: skip
    return taken


def _words(name: str) -> frozenset[str]:
    """Return the words of a name but those for colour and depth."""
    return frozenset(word.removesuffix("s") for word in _WORD.findall(name.lower())) - {*COLOR_WORDS, *DEPTH_WORDS}
