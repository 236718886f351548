"""All poses and landmarks of a survey and the camera's numbers, adjusted together (Levenberg-Marquardt, robust)."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import cho_solve, cholesky, solve_triangular

from odom.backend.mapping.bundle_adjustment import Bundle
from odom.backend.tracking.tuning import TUNING as TRACKING
from odom.calibration.normal_equations import reduce_survey, stepped
from odom.calibration.observation_terms import CameraArrays
from odom.calibration.parameters import NAMES, SCALE_NUMBER, vector_of
from odom.calibration.resection import resected
from odom.calibration.survey import Survey
from odom.calibration.tuning import TUNING
from odom.geometry.arrays import Array, Index, Mask

FREE = np.array([k for k in range(len(NAMES)) if k != SCALE_NUMBER])
"""The numbers that images and depth can show; the scale of depth needs motion capture."""
_DAMPING = 1e-10
"""Levenberg-Marquardt's, at first and at the least: far above rounding, far below what a second ray says of a landmark
of which only rays are known. A poor calibration is found in a few full steps; damped ones would creep along the
directions in which a camera and its walk look nearly alike."""
_DAMPED = 100.0
"""Factor of the damping after a step that makes it worse."""
_SETTLED, _ROUNDING = 1e-2, 1e-6
"""Shares of the cost: what a step that is not made any more would gain at the most, for each sigma that it may be long,
and what one may lose by rounding."""
_HELD = 1e-9
"""Added to the diagonal, so that a pose without observations does not move."""


@dataclass(frozen=True, eq=False)
class Prior:
    """What is known of the camera's numbers beforehand: `mean` and `sigma` (28)."""

    mean: Array
    sigma: Array


@dataclass(frozen=True, eq=False)
class System:
    """The normal equations of a `survey` in its poses and the numbers `free` (p) of its camera (see `reduce_survey`).

    They are those at a camera's `vector` (28), poses T_camera_map (K x 4 x 4) and `landmarks`.
    """

    survey: Survey
    vector: Array
    free: Index
    T_camera_map: Array
    landmarks: Array
    S: Array
    rhs: Array
    V_inverse: Array
    b: Array
    W_number: Array
    W: Array
    cost: float

    @classmethod
    def of(cls, survey: Survey, vector: Array, bundle: Bundle, free: Index, damping: float = _DAMPING) -> "System":
        """Return the normal equations at a camera's `vector` (28) and the poses and landmarks of `bundle`."""
        T, landmarks, camera = bundle.T_camera_map, bundle.landmarks, camera_arrays(survey, vector, free)
        pose, cauchy = places(survey), TRACKING.cauchy_chi2
        reduced = reduce_survey(T, landmarks, camera, pose, survey.arrays, damping, cauchy)
        return cls(survey, vector, free, T, landmarks, *reduced)

    @classmethod
    def at_start(cls, survey: Survey, free: Index) -> "System":
        """Return the normal equations at the camera, poses and landmarks with which a survey begins."""
        return cls.of(survey, vector_of(survey.camera), start_of(survey), free)

    @property
    def bundle(self) -> Bundle:
        """The poses and landmarks."""
        return Bundle(self.T_camera_map, self.landmarks, np.zeros(0))

    def factor(self, known: Array, damping: float) -> Array:
        """Return the lower triangle of S with what is `known` of the numbers (p, information); raises LinAlgError."""
        S, numbers = self.S.copy(), len(known)
        S.flat[:: len(S) + 1] += damping * np.diag(S) + _HELD
        S.flat[(len(S) - numbers) * (len(S) + 1) :: len(S) + 1] += known
        return np.asarray(cholesky(S, lower=True, overwrite_a=True, check_finite=False))

    @cached_property
    def follows(self) -> Array:
        """How the free poses follow the numbers (6 free poses x p)."""
        numbers = len(self.free)
        S_poses = self.S[:-numbers, :-numbers].copy()
        S_poses.flat[:: len(S_poses) + 1] += _HELD
        return np.ascontiguousarray(-np.linalg.solve(S_poses, self.S[:-numbers, -numbers:]))

    def information(self, known: Array) -> Array:
        """Return what the observations say of the numbers (p x p), and what is `known` of them (p), without damping."""
        numbers = len(known)
        return np.asarray(self.S[-numbers:, -numbers:] + self.S[-numbers:, :-numbers] @ self.follows + np.diag(known))

    def step(self, prior: Prior, damping: float = _DAMPING) -> tuple[Array, Array, Array]:
        """Return the step of poses and numbers that lowers the cost most, the gradient (both n) and the factor of S."""
        known, numbers = prior.sigma[self.free] ** -2.0, len(self.free)
        gradient = self.rhs.copy()
        gradient[len(gradient) - numbers :] -= known * (self.vector - prior.mean)[self.free]
        factor = self.factor(known, damping)
        return cho_solve((factor, True), gradient, check_finite=False), gradient, factor

    def stepped(self, step: Array) -> tuple[Array, Bundle]:
        """Return the camera's numbers, poses and landmarks after a `step` of all but the landmarks, which follow."""
        vector = self.vector.copy()
        vector[self.free] += step[len(step) - len(self.free) :]
        T, landmarks = stepped(
            self.T_camera_map, self.landmarks, places(self.survey), self.survey.frame, self.survey.landmark,
            self.V_inverse, self.b, self.W_number, self.W, step,
        )  # fmt: skip
        return vector, Bundle(T, landmarks, np.zeros(0))


@dataclass(frozen=True, eq=False)
class Fit:
    """An adjusted camera with poses and landmarks: the `system` there.

    `information` (p x p) is what the observations and the prior say of the numbers that were adjusted, as far as errors
    are independent.
    """

    system: System
    information: Array

    @property
    def vector(self) -> Array:
        """The camera's numbers (28)."""
        return self.system.vector

    @property
    def free(self) -> Index:
        """Which of them were adjusted (p)."""
        return self.system.free

    @property
    def bundle(self) -> Bundle:
        """The poses and landmarks."""
        return self.system.bundle


def camera_arrays(survey: Survey, vector: Array, free: Index) -> CameraArrays:
    """Return a camera with `vector` (28) for compiled loops, with columns for its numbers `free` (p)."""
    column = np.full(len(NAMES), -1, dtype=np.int64)
    column[free] = np.arange(len(free))
    size = np.array([survey.camera.width, survey.camera.height], dtype=np.float64)
    return vector, vector_of(survey.camera), size, column


def places(survey: Survey) -> Index:
    """Return where each frame's six unknowns begin (K), -1 for a pose that is held."""
    is_free = ~survey.is_fixed
    return np.where(is_free, 6 * (np.cumsum(is_free) - 1), -1)


def start_of(survey: Survey) -> Bundle:
    """Return the poses and landmarks with which a survey begins."""
    return Bundle(survey.T_camera_map, survey.landmarks, np.zeros(0))


def fit(
    start: System,
    prior: Prior,
    stopped: Callable[[], bool] = lambda: False,
    steps: int = TUNING.fit_steps,
    settled: float = TUNING.fit_settled,
) -> Fit:
    """Return the camera's free numbers, the poses and the landmarks that fit a survey best, from `start` on.

    One step is made and at most `steps`, each from equations of its own, until the next would be below `settled` sigma.
    Ends early, with what was found so far, once `stopped` says so. Raises LinAlgError where there is no solution.
    """
    survey, free = start.survey, start.free
    known = prior.sigma[free] ** -2.0

    def cost_of(system: System) -> float:
        return system.cost + float(known @ (system.vector - prior.mean)[free] ** 2)

    now, damping = start, _DAMPING
    poses = len(now.S) - len(free)
    for number in range(steps):
        step, gradient, factor = now.step(prior, damping)
        end = factor[poses:, poses:]  # of the numbers' information, since they come last
        sigma = np.sqrt(np.diag(np.linalg.inv(end @ end.T)))
        is_small = bool((np.abs(step[poses:]) < settled * sigma).all())
        if number and is_small and gradient @ step < settled * _SETTLED * cost_of(now):
            break
        less = max(0.1 * damping, _DAMPING)
        trial = System.of(survey, *now.stepped(step), free, less)
        gained = cost_of(now) - cost_of(trial)
        if gained > 0.0:
            now, damping = trial, less
        elif gained > -_ROUNDING * cost_of(now):
            break
        else:
            damping *= _DAMPED
            now = System.of(survey, now.vector, now.bundle, free, damping)
        if stopped():
            break
    if damping > _DAMPING:  # what is said of the numbers must not depend on the damping that the steps ended with
        now = System.of(survey, now.vector, now.bundle, free)
    return Fit(now, now.information(known))


def likely_gain(system: System, prior: Prior) -> float:
    """Return by what share of the cost the free numbers could lower it, beyond what poses and landmarks can.

    From the equations at one camera alone: a score test.
    """
    factor = system.factor(prior.sigma[system.free] ** -2.0, _DAMPING)
    explained = solve_triangular(factor, system.rhs, lower=True, check_finite=False)[-len(system.free) :]
    return float(explained @ explained / system.cost)


def placed(survey: Survey, free: Mask, T_camera_map: Array, by: Fit, steps: int) -> Array:
    """Return poses (K x 4 x 4), those of the frames `free` (K) each placed by itself among the landmarks of `by`."""
    pose = np.where(free, np.arange(len(free)), -1)
    camera = camera_arrays(survey, by.vector, np.zeros(0, dtype=np.int64))
    return resected(T_camera_map, by.bundle.landmarks, camera, pose, survey.arrays, steps, TRACKING.cauchy_chi2)
