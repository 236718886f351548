"""Which corners of a new key frame stand still, as the last frames show: only those become landmarks."""

from collections import deque
from dataclasses import dataclass

import numpy as np

from odom.backend.map.corners import Corners
from odom.backend.map.map import Map
from odom.backend.mapping.tuning import TUNING
from odom.backend.tracking.other_motions import WhatElseMoves, what_else_moves
from odom.backend.tracking.posed_frame import PosedFrame
from odom.backend.tracking.tracked_frame import TrackedFrame
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.camera.stamp_clock import SteadyStamp
from odom.frontend.features.image_parts import parts_of
from odom.frontend.features.measurement import measure_exactly
from odom.frontend.features.view import View
from odom.frontend.matching.look_back import CornerPatches, EarlierView, Sighting, look_back
from odom.frontend.matching.moving_surfaces import DepthGrid, MovingCells, moving_cells
from odom.geometry import se3
from odom.geometry.arrays import Array, Mask
from odom.geometry.neighbours import nearest

_MOST_VIEWS = 16
"""Views kept, some 1 MB each."""


@dataclass(frozen=True, eq=False)
class _RecentView:
    """A frame with a pose; `T_reference_camera` is that in its reference key frame, with which it moves."""

    view: View
    reference: int
    T_reference_camera: Array
    twist: Array


class RecentViews:
    """The newest frames with a pose, thinned, in which the corners of a new key frame of `map_` are looked for."""

    def __init__(self, map_: Map) -> None:
        self._map = map_
        self._views: deque[_RecentView] = deque(maxlen=_MOST_VIEWS)
        self._looked: tuple[TrackedFrame, MovingCells | None] | None = None

    def remember(self, frame: PosedFrame) -> None:
        """Keep a frame with a pose, unless there is one of nearly the same time; those of a later time are dropped."""
        since_s = frame.view.since_s(self._views[-1].view) if self._views else np.inf
        if since_s < 0.0:
            self.forget()
        if not 0.0 <= since_s < TUNING.recent_apart_s:
            T_reference_camera = frame.T_reference_camera(self._map)
            twist = frame.twist if frame.tracked is None else frame.tracked.twist
            self._views.append(_RecentView(frame.view, frame.reference, T_reference_camera, twist))

    def forget(self) -> None:
        """Forget all: the next frame is of another segment."""
        self._views.clear()

    def compared_with(self, view: View, tracked: TrackedFrame) -> "ComparedView":
        """Return a tracked view with those to compare it with, independent of later changes of the map."""
        looked = self._looked[1:] if self._looked is not None and self._looked[0] is tracked else ()
        return ComparedView(view, tracked, self._earlier_views(view, tracked), looked)

    def moving(self, view: View, tracked: TrackedFrame, sensor: SensorModel) -> MovingCells | None:
        """Return which part of a tracked view moves; None if no view is recent enough to tell.

        It is noted for `compared_with`, so that it is judged once.
        """
        moving = self.compared_with(view, tracked).moving(sensor)
        self._looked = tracked, moving
        return moving

    def what_else_moves(
        self, view: View, tracked: TrackedFrame, sensor: SensorModel, is_warned: bool
    ) -> WhatElseMoves | None:
        """Return which other motions a tracked view shows (see `other_motions`); None where no view can tell.

        Where nothing else warned of the pose (`is_warned`), a first look at a few corners may be enough.
        """
        stamp = view.steady_stamp
        for recent in reversed(self._joined_views(tracked)):
            if TUNING.spread_least_s <= _since_s(recent, stamp) <= TUNING.spread_most_s:
                return what_else_moves(self._seen_from(recent, tracked), view, tracked.twist, sensor, is_warned)
        return None

    def _earlier_views(self, view: View, tracked: TrackedFrame) -> list[EarlierView]:
        """Return the views to look in, of the last while."""
        stamp, views = view.steady_stamp, self._joined_views(tracked)
        return [self._seen_from(one, tracked) for one in views if 0.0 < _since_s(one, stamp) <= TUNING.recent_s]

    def _joined_views(self, tracked: TrackedFrame) -> list[_RecentView]:
        """Return the views of a tracked one's segment: between others, the camera's motion is not known."""
        keyframes = self._map.keyframes
        segment = keyframes[tracked.reference].segment
        return [one for one in self._views if keyframes[one.reference].segment == segment]

    def _seen_from(self, recent: _RecentView, tracked: TrackedFrame) -> EarlierView:
        keyframe = self._map.keyframes[recent.reference]
        T_recent_map = se3.inverse(recent.T_reference_camera) @ keyframe.T_camera_map
        return EarlierView(recent.view, T_recent_map @ tracked.T_map_camera, recent.twist)


@dataclass(frozen=True, eq=False)
class ComparedView:
    """A `tracked` view and the `earlier` ones that it is compared with, which tell what stands still and what moves.

    `looked` holds the cells that move, if that was judged already. In a quick turn few views overlap with this one: in
    doubt, and where the depth of a whole view is compared, only those are looked in.
    """

    view: View
    tracked: TrackedFrame
    earlier: list[EarlierView]
    looked: tuple[MovingCells | None, ...]

    def standing(self, corners: Corners, sensor: SensorModel, in_doubt: bool) -> tuple[Mask, float]:
        """Return which `corners` (n) of the view may become landmarks, and in how much of the view most moved.

        See `standing_score` and `moved_share`. Without depth, a corner cannot be looked for in other views: it stands
        unless there is a crowd. Landmarks found where the pose puts them count as standing. Corners are
        measured again with the velocity that the rows of the image show: the mean velocity would shear a quick turn.
        While the pose is `in_doubt`, corners that no view can judge are refused, and those that stood for a frame or
        two only: a body that turns round does that, too, and in doubt its landmarks would not be outvoted.
        """
        view, tracked = self.view, self.tracked
        measured = measure_exactly(view, sensor, corners.uv, tracked.twist)
        known = np.flatnonzero(measured.values[:, 2] > 0.0)
        patches = CornerPatches.of(view, corners.uv[known], measured.take(known))
        evidence = _evidence(view, patches, _spread(self._overlapping if in_doubt else self.earlier), sensor)
        stands = np.zeros(len(corners.uv), dtype=np.bool_)
        score = standing_score(patches.position, evidence, in_doubt)
        stands[known] = score > (TUNING.standing_least if in_doubt else 0.0)
        judged = evidence.weight > 0.0
        uv = np.concatenate([corners.uv[known[judged]], tracked.inlier_landmarks.uv])
        moves = np.concatenate([score[judged] <= 0.0, np.zeros(tracked.inlier_count, dtype=np.bool_)])
        moved = moved_share(uv, moves)
        moving = self.moving(sensor)
        if in_doubt or (moving is not None and moving.share > TUNING.moving_crowd):
            stands[known[~judged]] = False
        else:
            stands[~corners.has_depth] = True
        return stands if moving is None else stands & ~moving.at(corners.uv), moved

    def moving(self, sensor: SensorModel) -> MovingCells | None:
        """Return which part of the view moves; None where no view is recent enough to tell."""
        if self.looked:
            return self.looked[0]
        earlier = _spread(self._overlapping)[: TUNING.moving_views]
        return moving_cells(DepthGrid.of(self.view, sensor, self.tracked.twist), earlier, sensor) if earlier else None

    @property
    def _overlapping(self) -> list[EarlierView]:
        """The earlier views from which the camera has turned little, and the newest."""
        return [one for one in self.earlier[:-1] if _turn(one) < TUNING.recent_turn_rad] + self.earlier[-1:]


def _spread(views: list[EarlierView]) -> list[EarlierView]:
    """Return as many of the views as are looked in, spread over all their time."""
    n = len(views)
    return [views[i] for i in np.linspace(0, n - 1, min(n, TUNING.recent_views)).round().astype(int)]


def _turn(earlier: EarlierView) -> float:
    """Return by what angle the camera has turned since (radians)."""
    return float(np.linalg.norm(se3.log(earlier.T_view_corners)[3:]))


def _since_s(earlier: _RecentView, stamp: SteadyStamp) -> float:
    return (stamp - earlier.view.steady_stamp) * 1e-9


@dataclass(frozen=True, eq=False)
class Evidence:
    """What earlier views say of n corners: `score` (n) from -`weight` (moves) to `weight` (stands); `moves` (n)."""

    score: Array
    weight: Array
    moves: Mask

    @classmethod
    def nothing(cls, n: int) -> "Evidence":
        """Return the evidence of no view."""
        return cls(np.zeros(n), np.zeros(n), np.zeros(n, dtype=np.bool_))

    def joined(self, seen: Sighting, age_s: float) -> "Evidence":
        """Return the evidence with a view of `age_s` ago; older ones weigh more, since slow things moved farther."""
        weight = age_s / (age_s + TUNING.slow_s)
        visible = seen.visible | seen.moves
        missed = visible & ~seen.stands & ~seen.moves
        score = 1.0 * seen.stands - seen.moves - TUNING.missed_weight * missed
        return Evidence(self.score + weight * score, self.weight + weight * visible, self.moves | seen.moves)


def _evidence(view: View, patches: CornerPatches, views: list[EarlierView], sensor: SensorModel) -> Evidence:
    """Return what earlier `views` say of the corners of a `view` that `patches` shows."""
    evidence = Evidence.nothing(len(patches.position))
    for earlier in views:
        evidence = evidence.joined(look_back(patches, earlier, sensor), view.since_s(earlier.view))
    return evidence


def standing_score(points: Array, evidence: Evidence, in_doubt: bool = False) -> Array:
    """Return a score (n) of n corners at `points` (n x 3, m): above 0 where they rather stand than move.

    A corner is judged with its neighbours in space, so that what was never seen before goes with the body that it is a
    part of, and a single false match does no harm. Where hardly anything was seen to move, all else stands (infinity),
    unless the pose is `in_doubt`: a body that has just come is not seen to move yet. In doubt, little evidence counts
    only in proportion. Other scores are between -3 and 3.
    """
    judged = np.flatnonzero(evidence.weight > 0.0)
    if not in_doubt and np.count_nonzero(evidence.moves) < max(TUNING.moving_least, TUNING.moving_share * len(judged)):
        return np.where(evidence.moves, -np.inf, np.inf)
    if not len(judged):
        return np.zeros(len(points))
    weight = np.where(evidence.weight > 0.0, evidence.weight, 1.0)
    own = evidence.score / np.maximum(weight, TUNING.standing_weight if in_doubt else 0.0)
    near = nearest(points, points[judged], min(TUNING.judged_neighbours, len(judged)))[0]
    around = own[judged][near].mean(axis=1)
    return np.asarray(own + TUNING.neighbours_weight * around)


def standing_since(view: View, corners: Corners, earlier: EarlierView, sensor: SensorModel) -> Mask:
    """Return which `corners` (n) of a view stand still, as an `earlier` view shows by itself, without a map."""
    patches = CornerPatches.of(view, corners.uv, corners.measurements)
    evidence = _evidence(view, patches, [earlier], sensor)
    return (evidence.weight > 0.0) & (standing_score(patches.position, evidence, True) > 0.0)


def moved_share(uv: Array, moved: Mask) -> float:
    """Return the share of an image's parts that moved: those where most of the corners did, at `uv` (n x 2 px).

    Only parts with a few corners count, and there must be enough of them; otherwise nothing is said to have moved.
    """
    part = parts_of(uv, TUNING.part_px)
    corners = np.bincount(part)
    tells = corners >= TUNING.part_corners
    if np.count_nonzero(tells) < TUNING.parts_least:
        return 0.0
    return float((np.bincount(part, moved) > 0.5 * corners)[tells].mean())
