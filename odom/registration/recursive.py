"""The filter that takes pairs as they come: one by one or in blocks, asked at any time, merged with others.

Its state is the information Y and y of x = vec[R | t] (the paper's extension of its nine states by the translation):
every pair adds `Y += H' inv(S) H`, `y += H' inv(S) p`, so the order of the pairs does not matter and instances that
saw different pairs add up to one that saw all. The H-infinity term `theta^2 L'L` a step is taken out when the filter
is asked, not before.
"""

from dataclasses import dataclass, field, replace
from enum import Enum, unique

import numpy as np

from odom.errors import InputError
from odom.registration.gate import bad_covariance
from odom.registration.kernels import accumulate, precisions, unpack
from odom.registration.linear import cholesky_solve
from odom.registration.pairs import Array, Pairs, Prior, Registration, Verdict, degenerate
from odom.registration.paper_form import nearest_rotation
from odom.registration.projection import project
from odom.registration.recursion import discount
from odom.registration.se3 import hat
from odom.registration.solve import checked, prior_information

_MAX_ROTATION_SIGMA = 0.2
_NINE = np.array([0, 1, 2, 4, 5, 6, 8, 9, 10])


@unique
class State(Enum):
    """What the filter estimates."""

    JOINT = "[R | t], twelve states"
    ROTATION = "R, the paper's nine states, between points about known centroids"


@dataclass(frozen=True, eq=False)
class Centroids:
    """The means (3) of the source and target points, which the rotation-only filter must know beforehand: eq. (4)."""

    source: Array
    target: Array


@dataclass(frozen=True, eq=False)
class RecursiveFilter:
    """A robust H-infinity filter for one rigid motion; a frozen value, `absorb` and `merge` return the next one.

    `prior` is a motion prediction: where S_k is linearised and, with a covariance, evidence. `centroids` makes it the
    rotation-only filter. `theta` = 1 / gamma (0: Kalman), `alpha` > 0 the norm-bounded form of the source's noise,
    else its second moment. Without a prior S_k is linearised at the estimate so far, so filters to be merged should
    share a prior.
    """

    prior: Prior | None = None
    centroids: Centroids | None = None
    theta: float = 0.1
    alpha: float = 0.0
    count: int = 0
    A: Array = field(default_factory=lambda: np.zeros((6, 10)))
    y: Array = field(default_factory=lambda: np.zeros(12))
    summed_noise: Array = field(default_factory=lambda: np.zeros((3, 3)))

    def __post_init__(self) -> None:
        if not (self.theta >= 0.0 and self.alpha >= 0.0 and np.isfinite(self.theta + self.alpha)):
            raise InputError(f"theta = {self.theta}, alpha = {self.alpha}: give finite values, not negative")

    @property
    def state(self) -> State:
        """Whether twelve or nine states are estimated."""
        return State.JOINT if self.centroids is None else State.ROTATION

    @property
    def information(self) -> Array:
        """Y (12 x 12) of vec[R | t], or (9 x 9) of vec R; without prior and H-infinity term."""
        Y = np.empty((12, 12))
        unpack(self.A, Y)
        return Y if self.centroids is None else Y[np.ix_(_NINE, _NINE)]

    @property
    def states(self) -> Array | None:
        """The linear estimate x (12 or 9), no rigid motion yet; None while some direction has not been seen."""
        y = self.y if self.centroids is None else self.y[_NINE]
        x = np.empty(len(y))
        return x if cholesky_solve(self.information.copy(), y, x) else None

    def absorb(self, pairs: Pairs) -> "RecursiveFilter":
        """Return the filter that has seen `pairs` (one or many) too.

        Raises InputError for values that are not finite, covariances that are not positive, or missing.
        """
        arrays = checked(pairs)
        q, p = arrays.q, arrays.p
        if self.centroids is not None:
            q, p = q - self.centroids.source, p - self.centroids.target
        W = np.empty((len(arrays.q), 8))
        R = self._linearised_at()
        bad = precisions(arrays.Sq, arrays.Sp, R, self.alpha, W)
        if bad >= 0:
            raise bad_covariance(bad)
        A, y = self.A.copy(), self.y.copy()
        accumulate(q, p, W, arrays.weights, A, y)
        noise = self.summed_noise.copy()
        if len(arrays.Sp):
            noise += arrays.Sp.sum(axis=0)
        if len(arrays.Sq):
            noise += R[:3, :3] @ arrays.Sq.sum(axis=0) @ R[:3, :3].T
        return replace(self, A=A, y=y, summed_noise=noise, count=self.count + int(np.count_nonzero(arrays.weights)))

    def merge(self, other: "RecursiveFilter") -> "RecursiveFilter":
        """Return the filter that has seen what both have; the prior that they share counts once.

        Raises InputError when the two do not share prior, centroids, theta and alpha (as the same values).
        """
        for name in ("prior", "centroids", "theta", "alpha"):
            if not _same(getattr(self, name), getattr(other, name)):
                raise InputError(f"filters with different {name} cannot be merged: start both from the same {name}")
        return replace(
            self,
            A=self.A + other.A,
            y=self.y + other.y,
            summed_noise=self.summed_noise + other.summed_noise,
            count=self.count + other.count,
        )

    def estimate(self) -> Registration:
        """Return the motion so far; `inliers` and `chi2` are empty, since pairs are not kept.

        `details`: count, theta and gamma as used (theta is halved until the filter exists), halvings, alpha.
        """
        Y, y = np.empty((12, 12)), self.y.copy()
        unpack(self.A, Y)
        H = np.zeros((6, 6))
        T = self._linearised_at()
        if self.centroids is not None:
            return self._rotation(Y[np.ix_(_NINE, _NINE)], y[_NINE], Y[_NINE][:, 3::4])
        Y0, T0 = prior_information(self.prior)
        if project(Y, y, Y0, T0, T, H) == 0:
            return degenerate(0, f"{self.count} pairs do not determine the motion")
        theta, halvings = discount(Y, y, H, self.count, self.theta)
        covariance = np.asarray(np.linalg.inv(H), dtype=np.float64)
        sigma = float(np.sqrt(covariance[3:, 3:].diagonal().max()))
        if (self.count < 3 and len(Y0) == 0) or not sigma < _MAX_ROTATION_SIGMA:
            return degenerate(
                0, f"after {self.count} pairs the rotation is uncertain by {np.degrees(sigma):.0f} degrees"
            )
        w = np.linalg.eigvalsh(H)
        return self._result(T, covariance, float(w[0] / w[-1]), theta, halvings)

    def _rotation(self, Y: Array, y: Array, G: Array) -> Registration:
        """Return the nine-state estimate: the nearest rotation, and the translation by eq. (4).

        `G` (9 x 3) is what the noise of the centroids, common to all pairs, does to `y`: its share is in the
        covariance.
        """
        assert self.centroids is not None
        w = np.linalg.eigvalsh(Y)
        if not w[0] > 1e-12 * w[-1]:
            return degenerate(0, f"{self.count} pairs do not determine nine states: points in a plane, or too few")
        theta, halvings = self.theta, 0
        while self.count * theta**2 >= 0.5 * w[0]:
            theta, halvings = 0.5 * theta, halvings + 1
        P = np.linalg.inv(Y - self.count * theta**2 * np.eye(9))
        x = np.linalg.solve(Y, y)
        R = nearest_rotation(np.asarray(x), np.asarray(P))
        B = np.stack([(R @ hat(e)).ravel() for e in np.eye(3)], axis=1)
        rotation = np.linalg.inv(B.T @ np.linalg.inv(P) @ B)
        T = np.eye(4)
        T[:3, :3] = R
        T[:3, 3] = self.centroids.target - R @ self.centroids.source  # eq. (4)
        J = np.concatenate([hat(self.centroids.source), np.eye(3)])  # d (rho, phi) / d phi: the centroids stay together
        common = J @ rotation @ B.T @ G  # d (rho, phi) / d (p' - R q'), the centroids' noise
        common[:3] -= R.T
        covariance = J @ rotation @ J.T + common @ self.summed_noise @ common.T / max(self.count, 1) ** 2
        return self._result(T, np.asarray(covariance), float(w[0] / w[-1]), theta, halvings)

    def _result(self, T: Array, covariance: Array, conditioning: float, theta: float, halvings: int) -> Registration:
        gamma = 1.0 / theta if theta > 0.0 else float("inf")
        details = {"count": float(self.count), "theta": theta, "gamma": gamma}
        return Registration(
            T,
            covariance,
            np.zeros(0, dtype=np.bool_),
            np.zeros(0),
            conditioning,
            Verdict.OK,
            details=details | {"halvings": float(halvings), "alpha": self.alpha},
        )

    def _linearised_at(self) -> Array:
        """Return a copy of where S_k and the projection begin: the prior, else the estimate so far."""
        T = np.eye(4)
        if self.prior is not None:
            return self.prior.T_target_source.copy()
        x = self.states
        if x is not None:
            rows = x.reshape(3, -1)
            T[:3, :3] = nearest_rotation(np.ascontiguousarray(rows[:, :3]).ravel())
            T[:3, 3] = rows[:, 3] if rows.shape[1] == 4 else 0.0
        return T


def _same(a: object, b: object) -> bool:
    """Return whether two settings of a filter are equal, arrays by value."""
    if a is b:
        return True
    if isinstance(a, Prior) and isinstance(b, Prior):
        return _same(a.T_target_source, b.T_target_source) and _same(a.covariance, b.covariance)
    if isinstance(a, Centroids) and isinstance(b, Centroids):
        return _same(a.source, b.source) and _same(a.target, b.target)
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        return bool(np.array_equal(a, b))
    return isinstance(a, float) and isinstance(b, float) and a == b
