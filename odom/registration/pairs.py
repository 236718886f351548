"""Input and output of every estimator: point pairs, a prior, and the result."""

from dataclasses import dataclass, field
from enum import Enum, unique
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from odom.errors import InputError
from odom.frame.brief import brief
from odom.geometry.arrays import Array
from odom.geometry.compiled import compiled

_ROUNDING = 1e-6
"""How far a covariance may be from symmetric, relative to its largest entry, and a rotation from orthonormal: more than
rounding ever makes."""


def _copied(name_is: str, value: Array | None) -> Array:
    if np.ma.isMaskedArray(value):
        raise InputError(f"{name_is} a masked array: leave the masked pairs out, or give a plain one, `.filled(...)`")
    try:
        return np.array(value, dtype=np.float64, order="C")
    except (TypeError, ValueError) as error:
        raise InputError(f"{name_is} no array of numbers ({error}): give one of numpy") from error


def _points(name: str, value: Array | None, n: int | None = None) -> Array:
    points = _copied(f"{name} are", value)
    if points.ndim != 2 or points.shape[1] != 3 or (n is not None and len(points) != n):
        raise InputError(f"{name} have shape {points.shape}: give {'n' if n is None else n} x 3 metres")
    return points


@compiled
def _first_uneven(covariances: Array) -> int:
    """Return the first of n 3 x 3 matrices that is not finite and symmetric but for rounding, -1 where all are."""
    for k in range(len(covariances)):
        C = covariances[k]
        largest = uneven = 0.0
        for i in range(3):
            for j in range(3):
                largest = max(largest, abs(C[i, j]))
                uneven = max(uneven, abs(C[i, j] - C[j, i]))
        if not uneven <= _ROUNDING * largest or not np.isfinite(C).all():
            return k
    return -1


def _covariances(name: str, value: Array | None, n: int) -> Array | None:
    if value is None:
        return None
    covariances = _copied(f"{name} are", value)
    if covariances.shape == (n, 3, 3):
        if (wrong := _first_uneven(covariances)) >= 0:
            raise InputError(f"{name}: that of pair {wrong} is not finite and symmetric; leave the pair out")
        return covariances
    if covariances.shape == (n, 3):
        diagonal = np.zeros((n, 3, 3))
        diagonal[:, (0, 1, 2), (0, 1, 2)] = covariances
        return diagonal
    raise InputError(f"{name} have shape {covariances.shape}: give {n} x 3 x 3, or {n} x 3 variances, in m^2")


@dataclass(frozen=True, eq=False, repr=False)
class Pairs:
    """n pairs of corresponding points: `points_target[k] = R points_source[k] + t`, but for noise.

    Points are n x 3 metres, each in its own frame; covariances are n x 3 x 3 m^2 in the frame of their points (n x 3
    is taken as the variances along the axes), None for points without noise. `weights` (n, positive or 0) multiply
    the information of a pair; None for 1. The arrays are copied. Raises InputError when a shape is wrong, a covariance
    not symmetric or an array masked; other values are checked where they are used, by the estimators.
    """

    points_source: Array
    points_target: Array
    covariances_source: Array | None = None
    covariances_target: Array | None = None
    weights: Array | None = None

    __repr__ = brief

    def __post_init__(self) -> None:
        source = _points("source points", self.points_source)
        n = len(source)
        object.__setattr__(self, "points_source", source)
        object.__setattr__(self, "points_target", _points("target points", self.points_target, n))
        for side in ("source", "target"):
            name = f"covariances_{side}"
            object.__setattr__(self, name, _covariances(f"{side} covariances", getattr(self, name), n))
        if self.weights is not None:
            weights = _copied("weights are", self.weights)
            if weights.shape != (n,):
                raise InputError(f"weights have shape {weights.shape}: give {n}")
            object.__setattr__(self, "weights", weights)

    def __len__(self) -> int:
        return len(self.points_source)

    def __getitem__(self, index: slice | NDArray[np.bool_] | NDArray[np.intp]) -> "Pairs":
        """Return the pairs that a slice, mask or array of indices selects."""

        def pick(values: Array | None) -> Array | None:
            return None if values is None else values[index]

        return Pairs(
            self.points_source[index],
            self.points_target[index],
            pick(self.covariances_source),
            pick(self.covariances_target),
            pick(self.weights),
        )


@compiled
def _is_rigid(T: Array) -> bool:
    """Return whether `T` (4 x 4) is finite, its rotation a proper one, its last row 0 0 0 1, but for rounding."""
    for i in range(4):
        for j in range(4):
            if not np.isfinite(T[i, j]):
                return False
        if not abs(T[3, i] - (1.0 if i == 3 else 0.0)) <= _ROUNDING:
            return False
    for i in range(3):
        for j in range(3):
            overlap = T[i, 0] * T[j, 0] + T[i, 1] * T[j, 1] + T[i, 2] * T[j, 2]
            if not abs(overlap - (1.0 if i == j else 0.0)) <= _ROUNDING:
                return False
    x = T[1, 1] * T[2, 2] - T[1, 2] * T[2, 1]
    y = T[1, 2] * T[2, 0] - T[1, 0] * T[2, 2]
    z = T[1, 0] * T[2, 1] - T[1, 1] * T[2, 0]
    return bool(T[0, 0] * x + T[0, 1] * y + T[0, 2] * z > 0.0)  # the determinant: not mirrored


@dataclass(frozen=True, eq=False, repr=False)
class Prior:
    """What is believed before the pairs are seen: a motion prediction.

    `T_target_source` is 4 x 4, its translation in metres. `covariance` (6 x 6, `se3` convention, m and rad) makes it
    evidence of its own, fused with the pairs; without it the pose is only where the search begins. Both are copied.
    Raises InputError for a matrix that is no rigid motion, and a covariance that is not symmetric and positive
    definite.
    """

    T_target_source: Array
    covariance: Array | None = None

    __repr__ = brief

    def __post_init__(self) -> None:
        T = _copied("the prior's T_target_source is", self.T_target_source)
        if T.shape != (4, 4) or not _is_rigid(T):
            if T.shape == (4, 4) and _is_rigid(T.T.copy()):
                raise InputError("the prior is transposed: give the translation in its last column, the matrix's .T")
            needs = "a finite 4 x 4 matrix with an orthonormal rotation that does not mirror and the last row 0 0 0 1"
            raise InputError(f"the prior is not a rigid motion: give {needs}")
        object.__setattr__(self, "T_target_source", T)
        if self.covariance is not None:
            P = _copied("the prior's covariance is", self.covariance)
            if P.shape != (6, 6) or not np.isfinite(P).all() or np.linalg.eigvalsh(P)[0] <= 0.0:
                raise InputError("the prior's covariance is not a positive 6 x 6 matrix: give one, or None for a hint")
            if not np.abs(P - P.T).max() <= _ROUNDING * np.abs(P).max():
                raise InputError(
                    "the prior's covariance is not symmetric: give the mean of it and its .T if that is meant"
                )
            object.__setattr__(self, "covariance", P)


@unique
class Verdict(Enum):
    """Whether a registration may be used."""

    OK = "ok"
    DEGENERATE = "degenerate"


@dataclass(frozen=True, eq=False, repr=False)
class Registration:
    """What an estimator says about n pairs.

    `T_target_source` (4 x 4) maps source points into the target frame; `covariance` (6 x 6) is that of xi =
    (translation, rotation) in `T_true = T_target_source @ exp(xi)`: metres and radians in the SOURCE frame. Both are
    NaN where the verdict is DEGENERATE, so that nothing can mistake them for a pose; `reason` then says why.
    `inliers` (n) marks the pairs used, `chi2` (n) is each pair's squared residual against its own covariance (3
    degrees of freedom; NaN where no motion was found). `conditioning` is the reciprocal condition number of the
    information matrix with rotations measured by the spread of the points (0: singular, or points in one place; 1
    perfect). `variance_factor` is the observed mean of chi2 against its expectation (1: the noise model is true; 4: the
    noise is twice the modelled); of `horn`, and of `wicp` and `em_icp` without covariances, which know no noise, it is
    the observed variance (m^2); of `RecursiveFilter`, which keeps no residuals, NaN. `scale` is eq. (4)'s, 1 unless
    asked.
    """

    T_target_source: Array
    covariance: Array
    inliers: NDArray[np.bool_]
    chi2: Array
    conditioning: float
    verdict: Verdict
    reason: str = ""
    variance_factor: float = 1.0
    scale: float = 1.0
    details: dict[str, float] = field(default_factory=dict)

    __repr__ = brief

    @property
    def ok(self) -> bool:
        """Whether the pose may be used."""
        return self.verdict is Verdict.OK


def degenerate(
    n: int, reason: str, chi2: Array | None = None, inliers: NDArray[np.bool_] | None = None
) -> Registration:
    """Return the result that has no pose, and says why."""
    return Registration(
        T_target_source=np.full((4, 4), np.nan),
        covariance=np.full((6, 6), np.nan),
        inliers=np.zeros(n, dtype=np.bool_) if inliers is None else inliers,
        chi2=np.full(n, np.nan) if chi2 is None else chi2,
        conditioning=0.0,
        verdict=Verdict.DEGENERATE,
        reason=reason,
    )


class Estimator(Protocol):
    """The one signature of all estimators."""

    def __call__(self, pairs: Pairs, prior: Prior | None = None) -> Registration:
        """Return the motion that maps the pairs' source points onto their target points."""
        ...
