"""Which part of the image shows what carries the camera: it looks the same wherever the camera goes.

Only what has texture tells. Depth does not: a level floor is at the same distance, too, while a robot drives over it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from odom.evaluation.diagnosis.finding import Finding, Verdict
from odom.frontend.features.images import grey_of
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
_STRONG, _CORNER = 0.95, 0.1
"""A place can be followed whose cornerness (the smaller eigenvalue of its gradients) is above this quantile of a look's
times the second number: patches are compared whatever their contrast."""
_CORNER_PX = 5
"""Side of the square whose gradients make a corner, in the reduced image: 20 px in one of 640."""
_BAD_CORNERS = 0.15
"""Fixed corners, as a share of those of a look, from which on they may be followed instead of the scene: .02 to .04 in
black rims of rectified images, .10 in a line of text, .16 to .18 in a painted deck on 5 % of the view, .36 to .41 on
15 %."""
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

    `corners` is how many fixed corners there are, as a share of those in a look; `again` is the share of the looks that
    the usual place shows again which is not fixed. Where the camera did not move enough, all that says nothing: see
    `are_known`.
    """

    mask: Mask
    looks: int
    corners: float = 0.0
    again: float = 1.0

    @property
    def are_known(self) -> bool:
        """Whether the camera moved enough to tell."""
        return self.looks >= _LEAST_LOOKS and self.share < _MOST_SHARE and self.again < _AGAIN

    @property
    def share(self) -> float:
        """The share of the image that stays the same."""
        return float(self.mask.mean())


def fixed_parts(images: Sequence[Image], known: Mask | None = None) -> FixedParts:
    """Return which part of a camera's images (H x W or H x W x 3, by time; at least one) stays while it moves.

    What is `known` (H x W) to stay is left out, as are images of another size than the first.
    """
    looks: list[Array] = []
    shape = images[0].shape[:2]
    images = [image for image in images if image.shape[:2] == shape]
    for k in np.unique(np.linspace(0, len(images) - 1, _IMAGES).round().astype(int)):
        texture = _texture(images[k])
        if not looks or _is_another_look(looks[-1], texture):
            looks.append(texture)
    if len(looks) < _LEAST_LOOKS:
        return FixedParts(np.zeros(shape, dtype=np.bool_), len(looks))
    n = len(looks)
    all_energy = _around(np.mean(np.square(looks), axis=0))
    by_chance = all_energy / n
    kept = (_around(np.square(np.mean(looks, axis=0))) - by_chance) / np.maximum(all_energy - by_chance, 1e-9)
    has_texture = all_energy > _TEXTURE**2
    unknown = np.ones(has_texture.shape, dtype=np.bool_) if known is None else ~_widened(_scaled(known, kept.shape))
    parts = _whole_parts((kept > _STAYS) & has_texture & unknown)
    again = _seen_again(looks, has_texture & unknown & ~parts)
    return FixedParts(_scaled(parts, shape), n, _share_of_corners(looks, parts), again)


def judge_fixed_parts(images: Sequence[Image], mask: Mask | None = None) -> Finding:
    """Judge how much of a camera's images stays the same while it moves, beside what a `mask` (H x W) marks already."""
    found = fixed_parts(images, mask)
    if not found.are_known:
        return Finding("own parts", NOT_SHOWN, Verdict.UNKNOWN)
    beside = "" if mask is None else " beside what is masked"
    corners = f", with {found.corners:.0%} as many corners as a look at the scene" if found.share else ""
    value = f"{found.share:.0%} of the image stays the same wherever the camera goes{beside}{corners}"
    advice = (
        "it shows what carries the camera: make a mask by odom mask SOURCE --out mask.png, and give --mask mask.png"
    )
    return Finding.judged("own parts", value, found.corners > _BAD_CORNERS, advice)


def _texture(image: Image) -> Array:
    """Return a grey, reduced image less its mean around each place."""
    grey = grey_of(np.ascontiguousarray(image))
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


def _share_of_corners(looks: list[Array], parts: Mask) -> float:
    """Return how many places of the fixed `parts` can be followed, as a share of those of the usual look."""
    some = np.array([_cornerness(look) for look in looks[:: max(1, len(looks) // _REFERENCES)]])
    least = _CORNER * float(np.median(np.quantile(some, _STRONG, axis=(1, 2))))
    fixed = np.count_nonzero(_cornerness(np.mean(looks, axis=0))[parts] > least)
    return fixed / max(1.0, np.count_nonzero(some > least) / len(some))


def _cornerness(image: Array) -> Array:
    return np.asarray(cv2.cornerMinEigenVal(image.astype(np.float32), _CORNER_PX), dtype=np.float64)


def _whole_parts(found: Mask) -> Mask:
    """Return the parts that are large enough, with what lies between their places, and a margin."""
    side = np.ones((_AROUND_PX, _AROUND_PX), np.uint8)
    closed = cv2.morphologyEx(found.astype(np.uint8), cv2.MORPH_CLOSE, side)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(closed)
    is_large = stats[:, cv2.CC_STAT_AREA] >= _LEAST_SHARE * found.size
    is_large[0] = False
    return _widened(is_large[labels])


def _widened(mask: Mask) -> Mask:
    margin = np.ones((2 * _MARGIN_PX + 1, 2 * _MARGIN_PX + 1), np.uint8)
    return np.asarray(cv2.dilate(mask.astype(np.uint8), margin) > 0)


def _scaled(mask: Mask, shape: tuple[int, ...]) -> Mask:
    return np.asarray(cv2.resize(mask.astype(np.uint8), shape[1::-1], interpolation=cv2.INTER_NEAREST) > 0)
