"""Whether to trust the pose of a frame: enough landmarks agree, and they are those that it should see."""

import numpy as np

from odom.backend.estimate import State
from odom.backend.tracking.tracked_frame import TrackedFrame
from odom.backend.tracking.tuning import TUNING
from odom.geometry.arrays import Array


def has_enough_inliers(tracked: TrackedFrame) -> bool:
    """Return whether enough landmarks agree with a pose for it to be considered at all."""
    return tracked.inlier_count >= TUNING.least_inliers


def is_same_view(tracked: TrackedFrame, previous: TrackedFrame | None) -> bool:
    """Return whether enough is left of what the `previous` frame saw (None: it began a segment).

    Landmarks do not vanish all at once: where few are left, the view has jumped. Those on a body that sets off are
    found elsewhere.
    """
    left = tracked.inlier_count + len(tracked.elsewhere)
    return left >= TUNING.least_share_left * (0 if previous is None else previous.inlier_count)


def is_known_place(tracked: TrackedFrame, has_other_support: bool = False) -> bool:
    """Return whether a frame shows what its key frames saw; fewer suffice where something else supports it."""
    share = TUNING.share_in_chain if has_other_support else TUNING.share_without_chain
    return tracked.found_again >= max(TUNING.found_again, share * tracked.visible_count)


def judge_pose(
    tracked: TrackedFrame, vague: int, covariance: Array, is_recovered: bool, lacks_depth: bool, doubt: str
) -> tuple[State, str]:
    """Return the state of a tracked frame, and the reason where it is not TRACKING.

    Of so many of its landmarks, `vague`, the depth is hardly known: they tell how the camera turned, not how far it
    went. `covariance` (6 x 6, `se3`) is the pose's; `is_recovered`: it was LOST before; `lacks_depth`: no landmark's
    depth has been measured for a while; `doubt`: what else speaks against the pose, empty where nothing does.
    """
    inliers = tracked.inlier_count
    if is_recovered:
        return State.RECOVERED, f"place recognised: {inliers} landmarks found again"
    if inliers < TUNING.sure_inliers:
        return State.UNCERTAIN, f"only {inliers} landmarks found again"
    known = inliers - vague
    if known < TUNING.sure_inliers:
        return State.UNCERTAIN, f"only {known} landmarks of known depth"
    both = covariance[:3, :3], covariance[3:, 3:]
    if both[0].trace() > TUNING.unsure_m**2 or both[1].trace() > TUNING.unsure_rad**2:  # else no axis is unsure
        sigma_m, sigma_rad = (float(np.sqrt(np.linalg.eigvalsh(C)[-1])) for C in both)
        if sigma_m > TUNING.unsure_m or sigma_rad > TUNING.unsure_rad:
            return State.UNCERTAIN, f"known to {100.0 * sigma_m:.0f} cm and {np.rad2deg(sigma_rad):.1f} deg only"
    if doubt:
        return State.UNCERTAIN, doubt
    if lacks_depth and known < TUNING.known_enough:
        return State.UNCERTAIN, "hardly any depth: tracked by known landmarks alone"
    return State.TRACKING, ""
