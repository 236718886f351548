"""The filter that takes pairs as they come: one by one or in blocks, asked at any time, merged with others.

Its state is the information Y and y of x = vec[R | t] (the paper's nine states of eq. 10, extended by the translation):
every pair adds `Y += C'inv(S) C`, `y += C'inv(S) p`, so the order of the pairs does not matter, and filters that saw
different pairs add up to one that saw all. The H-infinity term `theta^2 L'L` of each step is taken out when the filter
is asked, not before.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from odom.errors import InputError, check_type
from odom.geometry.arrays import Array
from odom.geometry.se3 import hat, so3_exp
from odom.registration.checked_arrays import checked
from odom.registration.conditioning import scaled_conditioning
from odom.registration.linear_algebra import cholesky_solve
from odom.registration.measurement_covariance import bad_covariance, precisions
from odom.registration.pair_information import accumulate, allow_for_source_noise, information_matrix
from odom.registration.pairs import Pairs, Prior, Registration, Verdict, degenerate
from odom.registration.paper.hinfinity import check_settings, discount
from odom.registration.paper.kalman_filter import horn_start
from odom.registration.paper.tuning import TUNING
from odom.registration.solution import prior_information
from odom.registration.tuning import TUNING as ENGINE
from odom.registration.weighted_projection import project_onto_se3

_NINE = np.array([0, 1, 2, 4, 5, 6, 8, 9, 10])
"""Which of the twelve states are the paper's nine, the rotation."""


@dataclass(frozen=True, eq=False)
class Centroids:
    """The means (3) of the source and target points, which the rotation-only filter must know beforehand: eq. (4)."""

    source: Array
    target: Array


@dataclass(frozen=True, eq=False)
class RecursiveFilter:
    """A robust H-infinity filter for one rigid motion; a frozen value, `absorb` and `merge` return the next one.

    `prior` is a motion prediction: where S_k is linearised and, with a covariance, evidence. `centroids` makes it the
    rotation-only filter of the paper's nine states, which takes no such evidence. `theta` = 1 / gamma (0: Kalman),
    `alpha` > 0 the norm-bounded form of the source's noise, else its second moment. Without a prior S_k is linearised
    at the estimate so far, first at Horn's motion of the pairs at hand (of fewer than 3 the source counts as noisy
    along all axes as along its worst), so filters to be merged should share a prior.
    Of the `count` pairs seen so far, `A` (6 x 10) and `y` (12) hold the sums (see `accumulate`), `summed_noise` (3 x 3,
    m^2) that of S_k, `spread` (4 x 4) that of h h' with h = [q 1], each over the mean variance of S_k. Raises
    InputError for settings that make no filter.
    """

    prior: Prior | None = None
    centroids: Centroids | None = None
    theta: float = TUNING.theta
    alpha: float = 0.0
    count: int = 0
    A: Array = field(default_factory=lambda: np.zeros((6, 10)))
    y: Array = field(default_factory=lambda: np.zeros(12))
    summed_noise: Array = field(default_factory=lambda: np.zeros((3, 3)))
    spread: Array = field(default_factory=lambda: np.zeros((4, 4)))

    def __post_init__(self) -> None:
        check_settings(self.theta, self.alpha)
        check_type("prior", self.prior, Prior | None, "Prior(T_target_source), or None")
        if self.centroids is not None and self.prior is not None and self.prior.covariance is not None:
            raise InputError("centroids and a prior with covariance: give Prior(T_target_source), or no centroids")

    @property
    def information(self) -> Array:
        """Y (12 x 12) of vec[R | t], or (9 x 9) of vec R; without prior and H-infinity term."""
        Y = np.empty((12, 12))
        information_matrix(self.A, Y)
        return Y if self.centroids is None else Y[np.ix_(_NINE, _NINE)]

    @property
    def states(self) -> Array | None:
        """The linear estimate x (12 or 9), no rigid motion yet; None while some direction has not been seen."""
        y = self.y if self.centroids is None else self.y[_NINE]
        x = np.empty(len(y))
        return x if cholesky_solve(self.information.copy(), y, x) else None

    def absorb(self, pairs: Pairs) -> "RecursiveFilter":
        """Return the filter that has seen `pairs` (one or many) too.

        Raises InputError for values that are not finite, covariances that are not positive definite, or missing.
        """
        arrays = checked(pairs)
        if self.centroids is not None:
            arrays = arrays._replace(q=arrays.q - self.centroids.source, p=arrays.p - self.centroids.target)
        W = np.empty((len(arrays.q), 8))
        is_first = self.prior is None and self.states is None
        R = horn_start(arrays) if is_first else self._linearised_at()
        if is_first and len(arrays.q) < 3 and len(arrays.Sq):
            arrays = arrays._replace(Sq=np.linalg.eigvalsh(arrays.Sq)[:, -1, None, None] * np.eye(3))
        bad = precisions(arrays.Sq, arrays.Sp, R, self.alpha, W)
        if bad >= 0:
            raise bad_covariance(bad)
        A, y = self.A.copy(), self.y.copy()
        accumulate(arrays.q, arrays.p, W, arrays.weights, A, y)
        allow_for_source_noise(arrays.Sq, R, W, arrays.weights, y)
        used = arrays.weights > 0.0
        Sq, Sp = (S[used].sum(axis=0) if len(S) else np.zeros((3, 3)) for S in (arrays.Sq, arrays.Sp))
        noise = self.summed_noise + Sp + R[:3, :3] @ Sq @ R[:3, :3].T
        h = np.column_stack([arrays.q, np.ones(len(arrays.q))])
        spread = self.spread + (h.T * (W[:, 6] * arrays.weights)) @ h
        count = self.count + int(np.count_nonzero(used))
        return replace(self, A=A, y=y, summed_noise=noise, spread=spread, count=count)

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
            spread=self.spread + other.spread,
            count=self.count + other.count,
        )

    def estimate(self) -> Registration:
        """Return the motion so far; `inliers` and `chi2` are empty and `variance_factor` NaN: pairs are not kept.

        The verdict is DEGENERATE for fewer than 3 pairs, points on a line and a rotation that is too unsure, unless the
        prior is evidence.
        `details`: count, theta and gamma as used (theta is halved until the filter exists), halvings, alpha.
        """
        Y, y = np.empty((12, 12)), self.y.copy()
        information_matrix(self.A, Y)
        H = np.zeros((6, 6))
        T = self._linearised_at()
        Y0, T0 = prior_information(self.prior)
        if len(Y0) == 0 and self.count >= 3 and self._is_line():
            return degenerate(0, f"{self.count} points lie on a line or in one place: no rotation, within their noise")
        if self.centroids is not None:
            return self._rotation(Y[np.ix_(_NINE, _NINE)], y[_NINE], Y[_NINE][:, 3::4], self.centroids)
        if project_onto_se3(Y, y, Y0, T0, T, H) == 0:
            return degenerate(0, f"{self.count} pairs do not determine the motion")
        theta, halvings = discount(Y, y, H, self.count, self.theta)
        covariance = np.asarray(np.linalg.inv(H), dtype=np.float64)
        sigma = float(np.sqrt(covariance[3:, 3:].diagonal().max()))
        if (self.count < 3 and len(Y0) == 0) or not sigma < ENGINE.max_rotation_sigma_rad:
            reason = f"after {self.count} pairs the rotation is uncertain by {np.degrees(sigma):.0f} degrees"
            return degenerate(0, reason)
        return self._result(T, covariance, H, np.zeros(3), theta, halvings)

    def _rotation(self, Y: Array, y: Array, G: Array, centroids: Centroids) -> Registration:
        """Return the nine-state estimate: the nearest rotation, and the translation by eq. (4).

        `G` (9 x 3) is what the noise of the centroids, common to all pairs, does to `y`: its share is in the
        covariance.
        """
        w = np.linalg.eigvalsh(Y)
        if not w[0] > 1e-12 * w[-1]:
            return degenerate(0, f"{self.count} pairs do not determine nine states: points in a plane, or too few")
        theta, halvings = self.theta, 0
        while self.count * theta**2 >= 0.5 * w[0]:
            theta, halvings = 0.5 * theta, halvings + 1
        information = Y - self.count * theta**2 * np.eye(9)
        R = nearest_rotation(np.asarray(np.linalg.solve(Y, y)), information)
        B = np.stack([(R @ hat(e)).ravel() for e in np.eye(3)], axis=1)
        rotation = np.linalg.inv(B.T @ information @ B)
        T = np.eye(4)
        T[:3, :3] = R
        T[:3, 3] = centroids.target - R @ centroids.source  # eq. (4)
        J = np.concatenate([hat(centroids.source), np.eye(3)])  # d (rho, phi) / d phi: the centroids stay together
        common = J @ rotation @ B.T @ G  # d (rho, phi) / d (p' - R q'), the centroids' noise
        common[:3] -= R.T
        covariance = J @ rotation @ J.T + common @ self.summed_noise @ common.T / max(self.count, 1) ** 2
        return self._result(T, np.asarray(covariance), np.linalg.inv(covariance), centroids.source, theta, halvings)

    def _result(
        self, T: Array, covariance: Array, H: Array, origin: Array, theta: float, halvings: int
    ) -> Registration:
        """Return the result of a motion and its information; `origin` (3, m) is that of the source points summed."""
        mean, scatter, total = self._scatter()
        spread = math.sqrt(max(0.0, float(np.trace(scatter)) / total))
        conditioning = scaled_conditioning(np.ascontiguousarray(H), mean + origin, spread)
        gamma = 1.0 / theta if theta > 0.0 else float("inf")
        details = {"count": float(self.count), "theta": theta, "gamma": gamma}
        details |= {"halvings": float(halvings), "alpha": self.alpha}
        none = np.zeros(0)
        return Registration(
            T, covariance, none > 0.0, none, conditioning, Verdict.OK, variance_factor=math.nan, details=details
        )

    def _scatter(self) -> tuple[Array, Array, float]:
        """Return the source points' mean (3), their scatter about it (3 x 3), weighted as `spread`, and all weights."""
        total = max(float(self.spread[3, 3]), 1e-300)  # 0 of a prior alone
        mean = self.spread[3, :3] / total
        return mean, self.spread[:3, :3] - total * np.outer(mean, mean), total

    def _is_line(self) -> bool:
        """Return whether the points scatter about a line by no more than their noise, as `registration_of` tells."""
        _, second, first = np.linalg.eigvalsh(self._scatter()[1])
        return bool(second < ENGINE.min_scatter_sigmas**2 * self.count or second < 1e-9 * first)

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


def nearest_rotation(x: Array, information: Array | None = None) -> Array:
    """Return the rotation (3 x 3) nearest to nine states: in the metric of their information, or Frobenius' without."""
    U, _, Vt = np.linalg.svd(x.reshape(3, 3))
    R: Array = U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt
    if information is None:
        return R
    for _ in range(20):
        B = np.stack([(R @ hat(e)).ravel() for e in np.eye(3)], axis=1)
        step: Array = np.asarray(np.linalg.solve(B.T @ information @ B, B.T @ information @ (x - R.ravel())))
        R = np.asarray(R @ so3_exp(step))
        if float(step @ step) < 1e-24:
            break
    return R


def _same(a: object, b: object) -> bool:
    """Return whether two settings of a filter are equal, arrays by value."""
    if isinstance(a, Prior | Centroids) and type(a) is type(b):
        return all(_same(x, y) for x, y in zip(vars(a).values(), vars(b).values(), strict=True))
    return bool(np.array_equal(np.asarray(a), np.asarray(b)))
