"""What the back-end says about one frame."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum, unique
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from odom.frame import Stamp
from odom.frame.brief import brief
from odom.geometry import se3
from odom.geometry.arrays import Array

if TYPE_CHECKING:
    from odom.frontend.matching.moving_surfaces import MovingCells  # which loads the compiler

NO_DEPTH = "no depth"
TOO_LITTLE = "too little to see"
NO_PLACE = "no known place recognised"
IMAGE_AGAIN = "the last image came again"
"""Reasons for which a frame is LOST."""


@unique
class State(Enum):
    """How far a frame's pose may be trusted; `Estimate.reason` says why it is not TRACKING.

    TRACKING: thirty landmarks of known depth or more agree, and nothing speaks against the pose; the first frame, too.
    UNCERTAIN: there is a pose, but by few landmarks, with hardly any depth, by prediction, by surfaces alone, known to
    more than 5 cm or 2 deg only (1 sigma), or in doubt because something moves.
    LOST: there is no pose.
    RECOVERED: the first pose after a loss: a known place was recognised, a new segment began, or the last segment goes
    on where surfaces have led.
    """

    TRACKING = "TRACKING"
    UNCERTAIN = "UNCERTAIN"
    LOST = "LOST"
    RECOVERED = "RECOVERED"

    @property
    def is_trusted(self) -> bool:
        """Whether there is a pose that may be trusted."""
        return self in (State.TRACKING, State.RECOVERED)


@dataclass(frozen=True, eq=False, repr=False)
class RelativePose:
    """The pose `T_earlier_current` of the current frame in the one of `stamp_earlier`.

    `covariance` is 6 x 6 (rho m, phi rad; `geometry.se3`). `inliers` counts the landmarks, or of a registration the
    pairs of points, that agree with it.
    """

    stamp_earlier: Stamp
    T_earlier_current: Array
    covariance: Array
    inliers: int = 0

    __repr__ = brief


@dataclass(frozen=True, eq=False, repr=False)
class ChainPose:
    """A frame's pose by the paper's chain of pairwise registrations alone, at its stamp.

    `covariance` (6 x 6, `se3`, camera frame) is that since the chain began, or began anew behind a hole. `hole` says
    why the frame could not be registered against an earlier one; it is empty where it was, and for the first frame.
    """

    T_chain_camera: Array
    covariance: Array
    hole: str = ""

    __repr__ = brief


@dataclass(frozen=True, eq=False, repr=False)
class ChainClosing:
    """The paper's closing test of the chain: C_last against C_1 (`direct`) and against C_last-1 (`pairwise`).

    Beside it the pose of C_last in C_1 by the chain and by the closed chain, and how many sigmas each is off `direct`.
    """

    direct: RelativePose
    T_first_last_chain: Array
    chain_sigma: float
    T_first_last_closed: Array
    closed_sigma: float
    pairwise: RelativePose | None

    __repr__ = brief


@dataclass(frozen=True, eq=False, repr=False)
class ClosedChain:
    """The chain adjusted so that `closures` hold as well as its links; `refused` counts the closures left out.

    Holes that no closure joins divide it into `pieces` (1 without any). The motion from one piece to another is
    unknown, and there is no `closing` test between two.

    At n `stamps` (ns) the chain's poses are multiplied by `T_closed_chain` (n x 4 x 4) from the left, which gives
    `T_closed_camera` (n x 4 x 4, at the middle row's time). Stamps ascend, except where they stepped back, which they
    had done `steps_back` (n) times by then.
    """

    stamps: NDArray[np.int64]
    steps_back: NDArray[np.int64]
    T_closed_chain: Array
    T_closed_camera: Array
    closures: int
    refused: int
    pieces: int
    closing: ChainClosing | None

    __repr__ = brief

    def moved(self, stamp: Stamp, T_chain_camera: Array, steps_back_since: int = 0) -> Array:
        """Return a chain's pose moved as the closed chain says; between two stamps the motion is interpolated.

        `steps_back_since` is how often the chain's stamps have stepped back since that pose.
        """
        steps_back = self.steps_back[-1] - steps_back_since
        first, end = (int(np.searchsorted(self.steps_back, steps_back, side)) for side in ("left", "right"))
        after = first + int(np.searchsorted(self.stamps[first:end], stamp, side="right"))
        before = max(after - 1, first)
        T_before = self.T_closed_chain[before] @ T_chain_camera
        if after in (first, end):
            return np.asarray(T_before)
        share = float(stamp - self.stamps[before]) / float(self.stamps[after] - self.stamps[before])
        T_after = self.T_closed_chain[after] @ T_chain_camera
        return np.asarray(T_before @ se3.exp(share * se3.log(se3.inverse(T_before) @ T_after)))


@dataclass(frozen=True, eq=False, repr=False)
class LoopCandidate:
    """One place that looked like an earlier one, and what became of it.

    `inliers` landmarks of the key frame of `candidate_stamp` were found again in the one of `stamp`, of which
    `T_candidate_current` is the pose in it, None where it was refused before that was known. `reason` says why the loop
    was `accepted` or refused.
    """

    stamp: Stamp
    candidate_stamp: Stamp
    inliers: int
    accepted: bool
    reason: str
    T_candidate_current: Array | None = None

    __repr__ = brief


@dataclass(frozen=True, eq=False, repr=False)
class Features:
    """The tracked features of a frame, for display: `uv` (n x 2 px) and n normalised residuals (NaN: not used)."""

    uv: Array
    residual_sigma: Array

    __repr__ = brief


@dataclass(frozen=True, eq=False, repr=False)
class TrajectoryPose:
    """A pose of the corrected trajectory at `stamp`, in `map`; `T_map_camera` is None where the camera was LOST.

    Poses of different values of `segment` have nothing to do with each other.
    """

    stamp: Stamp
    T_map_camera: Array | None
    segment: int

    __repr__ = brief


@dataclass(frozen=True, eq=False, repr=False)
class Estimate:
    """The causal estimate for the frame of this `sequence` number and `stamp`, as published.

    `state` says how far the pose may be trusted, `reason` in words why it is not TRACKING (else empty). Poses of
    different values of `segment` have nothing to do with each other: a new one begins after a loss where no known place
    is recognised.

    `T_odom_camera` is continuous within a segment and None when LOST; `covariance` (6 x 6, `se3` convention, camera
    frame) is that of `T_odom_camera` since the segment began. `T_map_odom` holds the corrections by loop closures;
    odom begins where the camera was at the stamp of a segment's first frame.

    `matches` landmarks were looked for in the frame, and `inliers` of them found where the pose says. `features` are
    those points of the image, None without any. `is_keyframe`: the frame became part of the map; `is_predicted`: its
    pose goes on with the motion before, nothing was measured. `loops` are the places that were recognised, or refused,
    since the frame before.

    `step` is the published pose relative to the previous frame's, `second` relative to the one about a second earlier,
    both with the covariance that the published trajectory claims for them; `pairwise` is the paper's independent
    registration of (C_i, C_i+1), and `chain` the pose that follows from these alone. `moving` says which part of the
    view moves, as it was last looked at, None where nothing could tell. `path` lists the key frames' poses
    (read-only) a few frames after they have changed at the latest, else None; `landmarks_map` (m x 3, map frame) is a
    thinned cloud of landmarks for display, sent with it. `timings_ms` is the processing time of each stage.
    """

    sequence: int
    stamp: Stamp
    state: State
    reason: str
    segment: int
    T_map_odom: Array
    T_odom_camera: Array | None = None
    covariance: Array | None = None
    inliers: int = 0
    matches: int = 0
    is_keyframe: bool = False
    is_predicted: bool = False
    step: RelativePose | None = None
    second: RelativePose | None = None
    pairwise: RelativePose | None = None
    chain: ChainPose | None = None
    loops: tuple[LoopCandidate, ...] = ()
    features: Features | None = None
    moving: "MovingCells | None" = None
    path: tuple[TrajectoryPose, ...] | None = None
    landmarks_map: Array | None = None
    timings_ms: Mapping[str, float] = field(default_factory=dict)

    __repr__ = brief


OnPose = Callable[[Estimate], None]
"""Takes the estimate of a frame as soon as its pose is known (see `Odometry.process`)."""


@dataclass(frozen=True, eq=False, repr=False)
class ClosingTest:
    """The paper's test of a closed walk: the last frame registered against its predecessor and against the first.

    `direct` is the last frame's pose in the first one from what both see, with its covariance;
    `T_first_last_trajectory` the same from the final trajectory; `pairwise` the last frame's pose in its predecessor.
    """

    direct: RelativePose
    T_first_last_trajectory: Array
    pairwise: RelativePose | None
    disagreement_m: float
    disagreement_deg: float
    disagreement_sigma: float

    __repr__ = brief
