"""Clock offset and hand-eye transformation between motion capture and camera, jointly with the world alignment.

Model: `T_world_body(t + offset) @ T_body_camera = T_world_odom @ T_odom_camera(t)` for every frame t, in least
squares over all three unknowns at once (hand-eye form A X = Y B; F. Dornaika and R. Horaud, "Simultaneous
robot-world and hand-eye calibration", 1998). Odometry drifts, so its residuals are strongly correlated in time:
they are whitened by an autoregressive model fitted to themselves, and the uncertainty is the block sandwich
estimate, which stays honest when that model is not exact (W. Newey and K. West, 1987).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz
from scipy.spatial.transform import Rotation

from odom.errors import InputError
from odom.evaluation.alignment import align
from odom.evaluation.clock import ClockOffset, clock_offset
from odom.evaluation.smoothing import smooth
from odom.evaluation.trajectory import Trajectory, angles, inverse_all
from odom.registration import se3

Array = NDArray[np.float64]

_ORDER = 6
_WHITENINGS = 3
_ITERATIONS = 30
_CONVERGED = 1e-6
_MINIMUM = 20
_BLOCK_S = 1.0
_REACH_S = 0.04
_WILD = 3.0
"""Truth that turns so much faster than the camera ever does has jumped: such frames are left out."""

_LEASH_S = 0.025
_DERIVATIVE_S = 0.01
_CAUCHY = 24.0
"""Square of the whitened residual (6 on average) at which a frame's weight is halved."""

_PRIOR_SIGMA = np.array([1.0] * 3 + [3.0] * 3 + [np.inf] * 6 + [0.05])
_UNSURE_M, _UNSURE_RAD = 0.05, np.radians(3.0)
_WEAK_CORRELATION = 0.5


@dataclass(frozen=True, eq=False)
class CalibrationOptions:
    """What is known and what is to be estimated.

    `offset_s` and `T_body_camera` impose a value; None has it estimated.
    """

    offset_s: float | None = None
    T_body_camera: Array | None = None
    max_gap_s: float = 0.1
    search_s: float | None = None


@dataclass(frozen=True, eq=False)
class Calibration:
    """What ties a body's truth to the camera's estimate, with standard deviations (0: imposed).

    `offset_s` is added to a camera stamp to get the truth's. `hand_eye_sigma` (rho m, phi rad) is in the camera's
    frame; `correlation` is that of the two angular speeds at the offset (NaN when it was imposed).
    """

    offset_s: float
    offset_sigma_s: float
    T_body_camera: Array
    hand_eye_sigma: Array
    T_world_odom: Array
    correlation: float
    notes: tuple[str, ...]

    def camera_truth(self, truth_of_body: Trajectory) -> Trajectory:
        """Return the truth of the camera's optical frame on the camera's clock."""
        return truth_of_body.delayed(-self.offset_s).of_body(self.T_body_camera)


def calibrate(estimate: Trajectory, truth: Trajectory, options: CalibrationOptions | None = None) -> Calibration:
    """Return the calibration of a camera's `estimate` against the `truth` of a body fixed to the camera.

    Raises InputError when too few poses match in time.
    """
    options = options or CalibrationOptions()
    estimate = estimate.longest_segment()
    if options.offset_s is None:
        clock = clock_offset(estimate, truth, options.max_gap_s, options.search_s)
    else:
        clock = ClockOffset(options.offset_s, float("nan"))
    problem = _Problem.of(estimate, smooth(truth), clock.seconds, options)
    state = min((problem.refine(start, _UNWHITENED) for start in problem.starts()), key=problem.cost)
    for _ in range(_WHITENINGS):
        whiten = _Whitener.fit(problem.residuals(state, state.offset_s))
        state = problem.refine(state, whiten)
    sigma = problem.sigma(state, whiten)
    return Calibration(
        offset_s=state.offset_s,
        offset_sigma_s=float(sigma[12]),
        T_body_camera=state.T_body_camera,
        hand_eye_sigma=sigma[:6],
        T_world_odom=state.T_world_odom,
        correlation=clock.correlation,
        notes=_notes(sigma, clock),
    )


def _notes(sigma: Array, clock: ClockOffset) -> tuple[str, ...]:
    notes = []
    if clock.correlation < _WEAK_CORRELATION:
        notes.append(
            f"the angular speeds correlate only {clock.correlation:.2f}: the clock offset is a guess; "
            "turn the camera briskly a few times in the recording"
        )
    unsure_m = np.flatnonzero(sigma[:3] > _UNSURE_M)
    if len(unsure_m):
        names = ", ".join(f"{'xyz'[i]} to {sigma[i]:.2f} m" for i in unsure_m)
        notes.append(f"hand-eye translation is known only in {names}: the camera must turn about two axes at least")
    if (sigma[3:6] > _UNSURE_RAD).any():
        notes.append(
            f"hand-eye rotation is known only to {np.degrees(sigma[3:6].max()):.0f} deg: "
            "neither turns nor the shape of the path settle it"
        )
    return tuple(notes)


@dataclass(frozen=True, eq=False)
class _State:
    T_body_camera: Array
    T_world_odom: Array
    offset_s: float


@dataclass(frozen=True, eq=False)
class _Whitener:
    """Prediction-error filters of the six residuals (6 x taps), and the inverse root of what they leave (6 x 6).

    What they leave is correlated: seen from a camera, a small turn looks like a small step, so their errors go together
    as if the camera hung on a lever arm. Only the full 6 x 6 covariance keeps that out of the estimated one.
    """

    filters: Array
    inverse_root: Array

    @classmethod
    def fit(cls, residuals: Array) -> "_Whitener":
        """Fit autoregressive models (Yule-Walker) to n x 6 residuals, large ones clipped."""
        order = min(_ORDER, len(residuals) // 20)
        centred = residuals - np.median(residuals, axis=0)
        limits = 5.0 * 1.4826 * np.median(np.abs(centred), axis=0) + 1e-12
        clipped = np.clip(centred, -limits, limits)
        filters = []
        for r in clipped.T:
            c = np.array([(r[: len(r) - lag] * r[lag:]).sum() / r.size for lag in range(order + 1)])
            c[0] = c[0] * (1.0 + 1e-6) + 1e-18
            filters.append(np.concatenate([[1.0], -np.asarray(solve_toeplitz(c[:-1], c[1:]))]))
        innovations = cls(np.array(filters), np.eye(6))(clipped[:, :, None])[:, :, 0]
        covariance = innovations.T @ innovations / len(innovations)
        covariance += np.diag(1e-6 * np.diag(covariance) + 1e-18)
        return cls(np.array(filters), np.linalg.inv(np.linalg.cholesky(covariance)))

    def __call__(self, columns: Array) -> Array:
        """Return n x 6 x k columns filtered along time; the first few rows, which have no past, are left out."""
        from scipy.signal import lfilter  # takes half a second, which a viewer that starts does not have

        filtered = [lfilter(taps, [1.0], columns[:, k], axis=0) for k, taps in enumerate(self.filters)]
        return np.asarray(self.inverse_root @ np.stack(filtered, axis=1)[self.filters.shape[1] - 1 :])


_UNWHITENED = _Whitener(np.ones((6, 1)), np.eye(6) / 0.01)


@dataclass(frozen=True, eq=False)
class _Problem:
    """The frames that have truth within reach of the offset, and which of X (6), Y (6), offset (1) are free."""

    estimate: Trajectory
    truth: Trajectory
    offset_s: float
    imposed: Array | None
    free: NDArray[np.bool_]
    max_gap_s: float

    @classmethod
    def of(cls, estimate: Trajectory, truth: Trajectory, offset_s: float, options: CalibrationOptions) -> "_Problem":
        if len(estimate) < _MINIMUM:
            raise InputError(f"{len(estimate)} estimated poses: a calibration needs {_MINIMUM} at least")
        times = [estimate.stamps + round((offset_s + shift) * 1e9) for shift in (-_REACH_S, 0.0, _REACH_S)]
        sooner, now, later = (truth.at(stamps, options.max_gap_s) for stamps in times)
        valid = sooner[1] & now[1] & later[1]
        fastest = _WILD * float(np.percentile(_turns(estimate.T_world_body) / np.diff(estimate.stamps), 95)) * 1e9
        for before, after in ((sooner[0], now[0]), (now[0], later[0])):
            index = np.flatnonzero(valid)
            turned = angles((inverse_all(before[index]) @ after[index])[:, :3, :3])
            valid[index] = turned < (fastest + 0.5) * _REACH_S
        if valid.sum() < _MINIMUM:
            raise InputError(f"{valid.sum()} poses match truth in time: a calibration needs {_MINIMUM} at least")
        free = np.ones(13, dtype=bool)
        free[:6] = options.T_body_camera is None
        free[12] = options.offset_s is None
        gap_s = max(options.max_gap_s, 2 * _REACH_S)  # poses between valid ones are never missing
        return cls(estimate.take(valid), truth, offset_s, options.T_body_camera, free, gap_s)

    def body(self, offset_s: float) -> Array:
        """Return the body's poses (n x 4 x 4) at the frames' stamps plus an offset."""
        return self.truth.at(self.estimate.stamps + round(offset_s * 1e9), self.max_gap_s)[0]

    def starts(self) -> list[_State]:
        """Return states to start from: hand-eye rotation by relative rotations, by positions, and none."""
        W, C = self.body(self.offset_s), self.estimate.T_world_body
        if self.imposed is not None:
            hands = [self.imposed]
        else:
            stride = max(1, min(len(W) // 4, round(0.7 * len(W) / max(self.estimate.duration_s, 1e-3))))
            A = Rotation.from_matrix((inverse_all(W[:-stride]) @ W[stride:])[:, :3, :3]).as_rotvec()
            B = Rotation.from_matrix((inverse_all(C[:-stride]) @ C[stride:])[:, :3, :3]).as_rotvec()
            R_world_odom = align(C[:, :3, 3], W[:, :3, 3]).T_truth_estimate[:3, :3]
            hands = [np.eye(4) for _ in range(3)]
            hands[0][:3, :3] = align(np.vstack([B, -B]), np.vstack([A, -A])).T_truth_estimate[:3, :3]
            hands[1][:3, :3] = _mean(W[:, :3, :3].transpose(0, 2, 1) @ R_world_odom @ C[:, :3, :3])
        states = []
        for X in hands:
            Y = np.eye(4)
            Y[:3, :3] = _mean(W[:, :3, :3] @ X[:3, :3] @ C[:, :3, :3].transpose(0, 2, 1))
            Y[:3, 3] = ((W @ X)[:, :3, 3] - C[:, :3, 3] @ Y[:3, :3].T).mean(axis=0)
            states.append(_State(X, Y, self.offset_s))
        return states

    def residuals(self, state: _State, offset_s: float) -> Array:
        """Return n x 6: position (m, body) and rotation (rad, camera) of truth against the moved estimate."""
        body = self.body(offset_s)
        camera = body @ state.T_body_camera
        moved = state.T_world_odom @ self.estimate.T_world_body
        turned = moved[:, :3, :3].transpose(0, 2, 1) @ camera[:, :3, :3]
        apart = np.einsum("nji,nj->ni", body[:, :3, :3], camera[:, :3, 3] - moved[:, :3, 3])
        return np.column_stack([apart, Rotation.from_matrix(turned).as_rotvec()])

    def jacobian(self, state: _State) -> Array:
        """Return n x 6 x 13: by X exp(xi), by (turn of R_Y about the world's axes, shift of t_Y), by the offset."""
        R_world_body = self.body(state.offset_s)[:, :3, :3]
        R_world_camera = R_world_body @ state.T_body_camera[:3, :3]
        turned_points = self.estimate.positions @ state.T_world_odom[:3, :3].T
        J = np.zeros((len(self.estimate), 6, 13))
        J[:, :3, :3] = R_world_camera
        J[:, 3:, 3:6] = np.eye(3)
        J[:, :3, 6:9] = np.array([se3.hat(q) for q in turned_points])
        J[:, 3:, 6:9] = -R_world_camera.transpose(0, 2, 1)
        J[:, :3, 9:12] = -np.eye(3)
        J[:, :3, :12] = R_world_body.transpose(0, 2, 1) @ J[:, :3, :12]
        later, sooner = (self.residuals(state, state.offset_s + h) for h in (_DERIVATIVE_S, -_DERIVATIVE_S))
        J[:, :, 12] = (later - sooner) / (2 * _DERIVATIVE_S)
        return J[:, :, self.free]

    def normal_equations(self, state: _State, whiten: _Whitener) -> tuple[Array, Array, Array]:
        """Return H, g and the frames' scores (n x k) of the Cauchy-weighted problem with its weak prior."""
        r = whiten(self.residuals(state, state.offset_s)[:, :, None])[:, :, 0]
        J = whiten(self.jacobian(state))
        weights = 1.0 / (1.0 + np.square(r).sum(axis=1) / _CAUCHY)
        H = np.einsum("n,nij,nik->jk", weights, J, J)
        scores = -np.einsum("n,nij,ni->nj", weights, J, r)
        held = np.zeros(13)
        held[:3] = state.T_body_camera[:3, :3].T @ state.T_body_camera[:3, 3]
        information = 1.0 / np.square(_PRIOR_SIGMA)
        return H + np.diag(information[self.free]), scores.sum(axis=0) - (information * held)[self.free], scores

    def refine(self, state: _State, whiten: _Whitener) -> _State:
        """Return the state after Gauss-Newton steps to convergence."""
        for _ in range(_ITERATIONS):
            H, g, _scores = self.normal_equations(state, whiten)
            step = np.zeros(13)
            step[self.free] = np.linalg.solve(H, g)
            Y = state.T_world_odom.copy()
            Y[:3, :3] = se3.so3_exp(step[6:9]) @ Y[:3, :3]
            Y[:3, 3] += step[9:12]
            offset = float(np.clip(state.offset_s + step[12], self.offset_s - _LEASH_S, self.offset_s + _LEASH_S))
            state = _State(state.T_body_camera @ se3.exp(step[:6]), Y, offset)
            if np.abs(step).max() < _CONVERGED:
                break
        return state

    def cost(self, state: _State) -> float:
        """Return the robust cost of a state without whitening, to choose between starts."""
        r = _UNWHITENED(self.residuals(state, state.offset_s)[:, :, None])
        return float(np.log1p(np.square(r).sum(axis=1) / _CAUCHY).sum())

    def sigma(self, state: _State, whiten: _Whitener) -> Array:
        """Return 13 standard deviations: the larger of the plain and the block sandwich estimate."""
        H, _, scores = self.normal_equations(state, whiten)
        bread = np.linalg.inv(H)
        per_block = max(1, round(_BLOCK_S * len(self.estimate) / max(self.estimate.duration_s, 1e-3)))
        blocks = np.array([part.sum(axis=0) for part in np.array_split(scores, max(len(scores) // per_block, 2))])
        meat = np.einsum("bi,bj->ij", blocks, blocks) * len(blocks) / (len(blocks) - 1)
        out = np.zeros(13)
        out[self.free] = np.sqrt(np.maximum(np.diag(bread), np.diag(bread @ meat @ bread)))
        return out


def _turns(T: Array) -> Array:
    return angles((inverse_all(T[:-1]) @ T[1:])[:, :3, :3])


def _mean(R: Array) -> Array:
    return np.asarray(Rotation.from_matrix(R).mean().as_matrix())
