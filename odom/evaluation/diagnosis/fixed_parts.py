"""Which part of the image shows what carries the camera: it looks the same wherever the camera goes.

Only what has texture tells. Depth does not: a level floor is at the same distance, too, while a robot drives over it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from odom.evaluation.diagnosis.finding import Finding, Verdict
from odom.geometry.arrays import Array, Image, Mask

_WIDTH_PX = 160
"""Images are compared in this width: a part that is smaller than a few of its pixels does no harm."""
_AROUND_PX = 7
"""Side of the square in which texture is compared. Smaller: chance alikeness; larger: edges are washed out."""
_TEXTURE = 2.0
"""Grey levels, root mean square, from which on there is texture; noise has a half in images reduced so far."""
_CHANGED = 0.5
"""Correlation with the look before, below which a place has changed."""
_MOST_CHANGED = 0.3
"""Share of the places with texture that must have changed for a frame to be a look at another part of the scene."""
_IMAGES = 120
"""Images that are looked at, spread over all: more only cost time."""
_LEAST_LOOKS = 24
"""Looks at other parts of the scene: in fewer, some of fr1_rpy stays the same by chance; a walk of 6 s has more."""
_STAYS = 0.6
"""Share of its texture that a place keeps in the mean of all looks, from which on it is fixed: the scene keeps next
to nothing, what carries the camera all but its noise and the light's changes."""
_LEAST_SHARE = 0.003
"""Share of the image below which a fixed part is left out: a dead pixel or a speck of dirt does no harm."""
_MARGIN_PX = 3
"""Width by which the part found is made wider: a landmark's patch must not reach into it."""
_BAD_SHARE = 0.02
"""Share of the image from which on a fixed part may be followed instead of the scene."""
_MOST_SHARE = 0.6
"""Share of the image that no carrier covers: where more stays the same, the camera rests, and something else moves."""
_REFERENCES = 8
"""Looks with which all others are compared, spread over all, to tell whether the camera rests."""
_ALIKE = 0.8
"""Correlation above which a place shows again what it has shown before, to a fraction of a pixel."""
_AGAIN = 0.15
"""Share of the looks that the usual place outside the fixed part shows again, from which on the camera rests and
people walk before it: at rest .27 to .5, with bodies of 30 to 90 % of the view; .02 to .07 of fr1, a hololens and the
arena."""
NOT_SHOWN = "the camera does not move enough to tell what of the image stays the same wherever it goes"


@dataclass(frozen=True, eq=False)
class FixedParts:
    """What of the image stays the same: `mask` (H x W). `looks` at other parts of the scene showed it.

    `again` is the share of the looks that the usual place shows again which is not fixed. Where the camera did not move
    enough, all that says nothing: see `are_known`.
    """

    mask: Mask
    looks: int
    again: float = 1.0

    @property
    def are_known(self) -> bool:
        """Whether the camera moved enough to tell."""
        return self.looks >= _LEAST_LOOKS and self.share < _MOST_SHARE and self.again < _AGAIN

    @property
    def share(self) -> float:
        """The share of the image that stays the same."""
        return float(self.mask.mean())


def fixed_parts(images: Sequence[Image]) -> FixedParts:
    """Return which part of a camera's images (H x W or H x W x 3, by time; at least one) stays while it moves."""
    looks: list[Array] = []
    for k in np.unique(np.linspace(0, len(images) - 1, _IMAGES).round().astype(int)):
        texture = _texture(images[k])
        if not looks or _is_another_look(looks[-1], texture):
            looks.append(texture)
    shape = images[0].shape[:2]
    if len(looks) < _LEAST_LOOKS:
        return FixedParts(np.zeros(shape, dtype=np.bool_), len(looks))
    n = len(looks)
    all_energy = _around(np.mean(np.square(looks), axis=0))
    by_chance = all_energy / n
    kept = (_around(np.square(np.mean(looks, axis=0))) - by_chance) / np.maximum(all_energy - by_chance, 1e-9)
    has_texture = all_energy > _TEXTURE**2
    parts = _whole_parts((kept > _STAYS) & has_texture)
    return FixedParts(_over_image(parts, shape), n, _seen_again(looks, has_texture & (parts == 0)))


def judge_fixed_parts(images: Sequence[Image], mask: Mask | None = None) -> Finding:
    """Judge how much of a camera's images stays the same while it moves, beside what a `mask` (H x W) marks already."""
    found = fixed_parts(images)
    if not found.are_known:
        return Finding("own parts", NOT_SHOWN, Verdict.UNKNOWN)
    share = found.share if mask is None or mask.shape != found.mask.shape else float((found.mask & ~mask).mean())
    beside = "" if mask is None else " beside what is masked"
    value = f"{share:.0%} of the image stays the same wherever the camera goes{beside}"
    advice = (
        "it shows what carries the camera: make a mask by odom mask SOURCE --out mask.png, and give --mask mask.png"
    )
    return Finding.judged("own parts", value, share > _BAD_SHARE, advice)


def _texture(image: Image) -> Array:
    """Return a grey, reduced image less its mean around each place."""
    grey = image if image.ndim == 2 else cv2.cvtColor(np.ascontiguousarray(image), cv2.COLOR_RGB2GRAY)
    size = _WIDTH_PX, max(1, round(grey.shape[0] * _WIDTH_PX / grey.shape[1]))
    small = cv2.resize(grey, size, interpolation=cv2.INTER_AREA).astype(np.float64)
    return np.asarray(small - _around(small))


def _around(image: Array) -> Array:
    return np.asarray(cv2.blur(image, (_AROUND_PX, _AROUND_PX)))


def _is_another_look(before: Array, now: Array) -> bool:
    """Return whether enough of what has texture has changed since the look before."""
    has_texture = _around(now * now) + _around(before * before) > 2.0 * _TEXTURE**2
    return bool(has_texture.any() and (_correlation(before, now)[has_texture] < _CHANGED).mean() > _MOST_CHANGED)


def _correlation(one: Array, other: Array) -> Array:
    energy = _around(one * one) * _around(other * other)
    return np.asarray(_around(one * other) / np.sqrt(np.maximum(energy, 1e-9)))


def _seen_again(looks: list[Array], places: Mask) -> float:
    """Return in what share of the looks the usual one of the `places` shows what it showed in another one.

    A place that something passes shows the same scene before and after, if the camera rests.
    """
    if not places.any():
        return 1.0
    references = looks[:: max(1, len(looks) // _REFERENCES)]
    alike = [np.mean([_correlation(one, other)[places] > _ALIKE for other in looks], axis=0) for one in references]
    return float(np.median(np.max(alike, axis=0)))


def _whole_parts(found: Mask) -> Image:
    """Return the parts that are large enough, with what lies between their places, and a margin (1 there, else 0)."""
    side = np.ones((_AROUND_PX, _AROUND_PX), np.uint8)
    closed = cv2.morphologyEx(found.astype(np.uint8), cv2.MORPH_CLOSE, side)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(closed)
    is_large = stats[:, cv2.CC_STAT_AREA] >= _LEAST_SHARE * found.size
    is_large[0] = False
    margin = np.ones((2 * _MARGIN_PX + 1, 2 * _MARGIN_PX + 1), np.uint8)
    return np.asarray(cv2.dilate(is_large[labels].astype(np.uint8), margin))


def _over_image(small: Image, shape: tuple[int, int]) -> Mask:
    return np.asarray(cv2.resize(small, shape[::-1], interpolation=cv2.INTER_NEAREST) > 0)
