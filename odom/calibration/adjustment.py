"""All poses and landmarks of a survey and the camera's parameters, adjusted together (Levenberg-Marquardt, robust)."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from odom.backend.mapping.bundle_adjustment import Bundle
from odom.backend.tracking.tuning import TUNING as TRACKING
from odom.calibration.normal_equations import reduce_survey, stepped
from odom.calibration.observation_terms import CameraArrays
from odom.calibration.parameters import NAMES, SCALE_NUMBER, vector_of
from odom.calibration.resection import intersected, resected
from odom.calibration.survey import Survey
from odom.calibration.tuning import TUNING
from odom.geometry.arrays import Array, Index, Mask

FREE = np.array([k for k in range(len(NAMES)) if k != SCALE_NUMBER])
"""The parameters that images and depth can show; the scale of depth needs motion capture."""
_DAMPING = 1e-10
"""First and least damping: far above rounding, far below what a second ray says of a landmark of which only rays are
known. A few full steps mend a poor calibration; damped ones would creep along the directions in which camera and poses
can hardly be told apart."""
_MORE_DAMPING = 100.0
"""Factor of the damping after a step that raised the cost."""
_SETTLED, _ROUNDING = 1e-2, 1e-6
"""Shares of the cost: what a step that is left out could gain at the most, for each sigma of its length, and what one
may lose by rounding."""
_HELD = 1e-9
"""Added to the diagonal, so that a pose without observations does not move."""


@dataclass(frozen=True, eq=False)
class Prior:
    """What is known of the camera's parameters beforehand: `mean` and `sigma` (30)."""

    mean: Array
    sigma: Array


@dataclass(frozen=True, eq=False)
class System:
    """The normal equations of a `survey` in its poses and its camera's parameters `free` (p); see `reduce_survey`.

    They hold at a camera's `vector` (30), poses T_camera_map (K x 4 x 4) and `landmarks` (L x 3, m), with `damping`.
    """

    survey: Survey
    vector: Array
    free: Index
    T_camera_map: Array
    landmarks: Array
    damping: float
    S: Array
    S_across: Array
    S_camera: Array
    rhs: Array
    rhs_camera: Array
    V_inverse: Array
    b: Array
    W_camera: Array
    W: Array
    cost: float

    @classmethod
    def of(cls, survey: Survey, vector: Array, bundle: Bundle, free: Index, damping: float = _DAMPING) -> "System":
        """Return the normal equations at a camera's `vector` (30) and the poses and landmarks of `bundle`."""
        T, landmarks, camera = bundle.T_camera_map, bundle.landmarks, camera_arrays(survey, vector)
        pose, cauchy = places(survey), TRACKING.cauchy_chi2
        reduced = reduce_survey(T, landmarks, camera, free, pose, survey.arrays, damping, cauchy)
        return cls(survey, vector, free, T, landmarks, damping, *reduced)

    @classmethod
    def at_start(cls, survey: Survey, free: Index) -> "System":
        """Return the normal equations at the camera, poses and landmarks with which a survey begins."""
        return cls.of(survey, vector_of(survey.camera), start_of(survey), free)

    @property
    def bundle(self) -> Bundle:
        """The poses and landmarks."""
        return Bundle(self.T_camera_map, self.landmarks, np.zeros(0))

    @cached_property
    def eliminated(self) -> tuple[Array, Array, Array]:
        """L, the lower triangle with S = L L' (n x n); inv(L) S_across (n x p); inv(L) rhs (n). May raise LinAlgError.

        This is the first of two stages of solving: the poses are eliminated, and the parameters remain.
        """
        S = self.S.copy().T  # of which the lower half is filled; factorised in place, in columns
        S.flat[:: len(S) + 1] += self.damping * np.diag(S) + _HELD
        L = np.asarray(cholesky(S, lower=True, overwrite_a=True, check_finite=False))
        solved = solve_triangular(L, np.column_stack([self.S_across, self.rhs]), lower=True, check_finite=False)
        return L, solved[:, :-1], solved[:, -1]

    def follow(self, step: Array) -> Array:
        """Return how the poses follow steps of the parameters (n or n x p)."""
        L, across, _ = self.eliminated
        return np.asarray(solve_triangular(L, -across @ step, lower=True, trans="T", check_finite=False))

    def information(self, prior: Prior) -> Array:
        """Return the information (p x p) on the parameters that the observations and a prior give."""
        across = self.eliminated[1]
        return np.asarray(self.S_camera - across.T @ across + np.diag(prior.sigma[self.free] ** -2.0))

    def pull(self, prior: Prior) -> Array:
        """Return the right side of the parameters' equations (p): where the cost falls, all else being at its best."""
        _, across, rest = self.eliminated
        off = (self.vector - prior.mean)[self.free]
        return np.asarray(self.rhs_camera - across.T @ rest - off / prior.sigma[self.free] ** 2)

    def stepped(self, step: Array) -> tuple[Array, Bundle]:
        """Return the camera's parameters, poses and landmarks after a `step` (p) of the parameters.

        Poses follow the step and go to where they fit best, as far as the equations say; to where they come to be, the
        landmarks are fitted anew. A poor calibration bends the whole way; where landmarks left it by straight lines,
        nearly all steps would be refused. Source: Y. Jeong et al., "Pushing the envelope of modern methods for bundle
        adjustment", IEEE PAMI 34, 2012 (embedded point iterations).
        """
        vector = self.vector.copy()
        vector[self.free] += step
        L, _, rest = self.eliminated
        of_poses = self.follow(step) + solve_triangular(L, rest, lower=True, trans="T", check_finite=False)
        T, landmarks = stepped(
            self.T_camera_map, self.landmarks, places(self.survey), self.survey.frame, self.survey.landmark,
            self.V_inverse, self.b, self.W_camera, self.W, of_poses, step,
        )  # fmt: skip
        camera, cauchy = camera_arrays(self.survey, vector), TRACKING.cauchy_chi2
        landmarks = intersected(T, landmarks, camera, self.survey.arrays, self.damping, cauchy)
        return vector, Bundle(T, landmarks, np.zeros(0))


@dataclass(frozen=True, eq=False)
class Fit:
    """An adjusted camera with poses and landmarks: the `system` there.

    `information` (p x p) is that of observations and prior on the parameters adjusted, if errors are independent.
    """

    system: System
    information: Array

    @property
    def vector(self) -> Array:
        """The camera's parameters (30)."""
        return self.system.vector

    @property
    def free(self) -> Index:
        """Which of them were adjusted (p)."""
        return self.system.free

    @property
    def bundle(self) -> Bundle:
        """The poses and landmarks."""
        return self.system.bundle

    def with_fixed(self, prior: Prior, fixed: Mask) -> "Fit":
        """Return the fit with some of the free parameters (`fixed`, p) fixed at the prior's mean.

        Poses, landmarks and the other parameters are where they would be by one step.
        """
        now, information, free = self.system, self.information, ~fixed
        step = np.where(fixed, (prior.mean - self.vector)[self.free], 0.0)
        pull = now.pull(prior) - information @ step
        step[free] = np.linalg.solve(information[np.ix_(free, free)], pull[free])
        system = System.of(now.survey, *now.stepped(step), self.free[free])
        return Fit(system, system.information(prior))


def camera_arrays(survey: Survey, vector: Array) -> CameraArrays:
    """Return a camera with `vector` (30) for compiled loops."""
    return vector, vector_of(survey.camera), np.array([survey.camera.width, survey.camera.height], dtype=np.float64)


def places(survey: Survey) -> Index:
    """Return where each frame's six unknowns begin (K), -1 for a pose that is fixed."""
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
    """Return the camera's free parameters, the poses and the landmarks that fit a survey best, from `start` on.

    At least one step is made and at most `steps`, each from new equations, until the next would be below `settled`
    sigma. Ends early, with what was found so far, once `stopped` says so. Raises LinAlgError if there is no solution.
    """
    survey, free = start.survey, start.free

    def cost_of(system: System) -> float:
        return system.cost + float(((system.vector - prior.mean)[free] ** 2) @ prior.sigma[free] ** -2.0)

    now = start
    for count in range(steps):
        information, pull = now.information(prior), now.pull(prior)
        information.flat[:: len(free) + 1] += now.damping * np.diag(now.S_camera)
        root = np.linalg.inv(np.linalg.cholesky(information))
        step, sigma = root.T @ (root @ pull), np.linalg.norm(root, axis=0)
        is_small = bool((np.abs(step) < settled * sigma).all())
        gain = pull @ step + now.eliminated[2] @ now.eliminated[2]
        if count and is_small and gain < settled * _SETTLED * cost_of(now):
            break
        less_damping = max(0.1 * now.damping, _DAMPING)
        trial = System.of(survey, *now.stepped(step), free, less_damping)
        gained = cost_of(now) - cost_of(trial)
        if gained > 0.0:
            now = trial
        elif gained > -_ROUNDING * cost_of(now):
            break
        else:
            now = System.of(survey, now.vector, now.bundle, free, _MORE_DAMPING * now.damping)
        if stopped():
            break
    if now.damping > _DAMPING:  # the information must not depend on the damping that the steps ended with
        now = System.of(survey, now.vector, now.bundle, free)
    return Fit(now, now.information(prior))


def likely_gain(system: System, prior: Prior) -> float:
    """Return by what share the free parameters could lower the cost, beyond what poses and landmarks can.

    It follows from the equations at one camera alone: a score test.
    """
    pull = system.pull(prior)
    return float(pull @ np.linalg.solve(system.information(prior), pull) / system.cost)


def placed(survey: Survey, free: Mask, T_camera_map: Array, by: Fit, steps: int) -> Array:
    """Return poses (K x 4 x 4), those of the frames `free` (K) each placed by itself among the landmarks of `by`."""
    pose = np.where(free, np.arange(len(free)), -1)
    camera = camera_arrays(survey, by.vector)
    return resected(T_camera_map, by.bundle.landmarks, camera, pose, survey.arrays, steps, TRACKING.cauchy_chi2)
