"""What moves in the view, judged some ten times a second, and whether that leaves the pose in doubt.

The words for it, from the weakest to the strongest. A pose is

- contested (`TrackedFrame`) where some of the landmarks found vote for another one;
- warned of there, after a doubt, and where landmarks from before do not speak for it: more corners are then looked at;
- suspicious where much moves, or something else moves as one: other motions in the view may be rivals of the camera's;
- denied (`Witnesses`) where landmarks from before contradict it;
- doubtful where any of this is enough to make it UNCERTAIN;
- left behind (`RivalMotions`) where another motion is the scene's: the camera follows a body, and the frame is LOST.
"""

from dataclasses import dataclass, field, replace

from odom.backend.map.landmarks import Landmarks
from odom.backend.mapping.standing import RecentViews
from odom.backend.odometry.crowd import Crowd
from odom.backend.odometry.rival_motions import RivalMotions
from odom.backend.odometry.tuning import TUNING
from odom.backend.odometry.witnesses import Agreement, Witnesses
from odom.backend.tracking.tracked_frame import TrackedFrame
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.camera.stamp_clock import SteadyStamp, is_within
from odom.frontend.features.view import View
from odom.frontend.matching.moving_surfaces import MovingCells

VIEW_MOVED = "of the view moved"
CONTRADICTED = "landmarks from before contradict the pose"
FOUND_IN_DOUBT = "lost in doubt, and perhaps found again by what moves"
OTHER_MOTION = "something else moves as one, and may be the scene"
DOUBTS = VIEW_MOVED, CONTRADICTED, FOUND_IN_DOUBT, OTHER_MOTION
"""With one of these ends the reason of a frame that is UNCERTAIN for what moves alone."""


@dataclass(frozen=True, eq=False)
class MovingView:
    """What moves in the view that was looked at last, at `stamp`, and whether it leaves the camera's pose in doubt.

    A camera that follows a moving body sees the scene move instead: much that moves (`crowd`) and other motions
    (`rivals`) raise a doubt, and landmarks from before it (`witnesses`) can settle it. `cells` says what moves, None
    where nothing could tell; `doubted_stamp`: when the pose was last in doubt.
    """

    stamp: SteadyStamp | None = None
    cells: MovingCells | None = None
    crowd: Crowd = field(default_factory=Crowd)
    witnesses: Witnesses = field(default_factory=Witnesses)
    rivals: RivalMotions = field(default_factory=RivalMotions)
    doubted_stamp: SteadyStamp | None = None

    def after(
        self, view: View, tracked: TrackedFrame, recent: RecentViews, landmarks: Landmarks, sensor: SensorModel
    ) -> "MovingView":
        """Return what is known after a tracked `view`, compared with `recent` ones; unchanged unless a look is due."""
        stamp = view.steady_stamp
        if is_within(TUNING.moving_period_s, self.stamp, stamp):
            return self
        seen = self._with_cells(stamp, recent.moving(view, tracked, sensor), tracked, landmarks)
        is_suspicious = seen.is_suspicious
        witnesses = seen.witnesses.with_root(tracked, landmarks, is_suspicious)
        proven = Agreement.of(tracked, landmarks, witnesses.proven_identity)
        is_warned = seen._is_warned(stamp, tracked, proven)
        others = recent.what_else_moves(view, tracked, sensor, is_warned)
        if others is None:
            rivals = replace(seen.rivals, is_left_behind=False)
        else:
            trusted = Agreement.of(tracked, landmarks, witnesses.trusted_identity)
            rivals = seen.rivals.after(stamp, others, witnesses, trusted, is_suspicious, is_warned)
            is_disputed = others.has_scene or rivals.large_stamp == stamp
            witnesses = witnesses.with_confirmation(others.is_confirmed, is_disputed, landmarks.next_identity)
        seen = replace(seen, witnesses=witnesses, rivals=rivals)
        seen = replace(seen, rivals=rivals.with_spread(others, seen.is_doubtful))
        return replace(seen, doubted_stamp=stamp) if seen.is_doubtful else seen

    def _with_cells(
        self, stamp: SteadyStamp, cells: MovingCells | None, tracked: TrackedFrame, landmarks: Landmarks
    ) -> "MovingView":
        """Return what is known after a look at `stamp` that showed `cells` move."""
        if cells is None:
            return replace(self, stamp=stamp, cells=None)
        trusted = Agreement.of(tracked, landmarks, self.witnesses.trusted_identity)
        is_after_doubt = is_within(TUNING.moved_parts_s, self.doubted_stamp, self.stamp)
        witnesses = self.witnesses.with_testimony(trusted, is_after_doubt)
        crowd = self.crowd.after(stamp, cells.share, trusted, witnesses.is_denied)
        seen = replace(self, stamp=stamp, cells=cells, crowd=crowd, witnesses=witnesses)
        if seen.is_suspicious or witnesses.denying_looks or not crowd.is_calm(stamp):
            return seen
        return replace(seen, witnesses=replace(witnesses, proven_identity=landmarks.next_identity))

    def _is_warned(self, stamp: SteadyStamp, tracked: TrackedFrame, proven: Agreement) -> bool:
        """Return whether a doubt, now or lately, or what `proven` landmarks say warns of the pose at `stamp`."""
        is_after_doubt = is_within(TUNING.moved_parts_s, self.doubted_stamp, stamp)
        is_doubted = self.is_suspicious or is_after_doubt or tracked.is_contested
        return is_doubted or not proven.testifies() or proven.contradicts()

    def restarted(self, fresh_identity: int) -> "MovingView":
        """Return what is known where a segment begins or the camera is found again: looks are counted anew.

        Landmarks of the segment that are made from then on begin with `fresh_identity`: 0 where it begins. After a loss
        in doubt, a view that seems to stand still proves little: a body that is followed looks the same.
        """
        crowd = replace(self.crowd, calm_stamp=None, first_stamp=None)
        crowd = replace(crowd, is_start_unsure=False, is_recovery_unsure=self.is_doubtful)
        witnesses = replace(self.witnesses, fresh_identity=fresh_identity, confirming_looks=0)
        rivals = replace(self.rivals, large_stamp=None, rival_stamp=None, is_left_behind=False)
        return MovingView(None, None, crowd, witnesses, rivals, self.doubted_stamp)

    def after_keyframe(
        self, stamp: SteadyStamp, moved_share: float, tracked: TrackedFrame, landmarks: Landmarks
    ) -> "MovingView":
        """Return what is known after a key frame, of whose view a `moved_share` was seen to move by its corners."""
        trusted = Agreement.of(tracked, landmarks, self.witnesses.trusted_identity)
        has_moved = moved_share > TUNING.moved_parts and not trusted.supports()
        return replace(self, crowd=replace(self.crowd, moved_keyframe_stamp=stamp if has_moved else None))

    @property
    def is_suspicious(self) -> bool:
        """Whether the pose may be in doubt, so that it is worth looking for what else moves as one."""
        has_moved_keyframe = self.crowd.moved_keyframe_stamp is not None
        return self.crowd.is_doubtful or has_moved_keyframe or self.rivals.is_rivalled(self.stamp)

    @property
    def is_doubtful(self) -> bool:
        """Whether what moves leaves the pose in doubt."""
        if self.crowd.is_doubtful or self.rivals.is_left_behind or self.rivals.is_rivalled(self.stamp):
            return True
        has_others = is_within(TUNING.moved_as_one_s, self.rivals.seen_stamp, self.stamp)
        return has_others and self.crowd.moved_keyframe_stamp is not None

    @property
    def is_at_rest(self) -> bool:
        """Whether nothing moves in the view, so that a camera that sees surfaces alone can follow them as the scene."""
        has_moved = is_within(TUNING.moving_calm_s, self.crowd.moved_stamp, self.stamp)
        return not (has_moved or self.is_doubtful)

    @property
    def doubt(self) -> str:
        """Why the pose is in doubt, empty where it is not."""
        if not self.is_doubtful:
            return ""
        if self.cells is not None and self.cells.share > TUNING.moving_most:
            return f"{self.cells.share:.0%} {VIEW_MOVED}"
        if self.witnesses.is_denied:
            return CONTRADICTED
        if self.crowd.is_recovery_unsure:
            return FOUND_IN_DOUBT
        if self.crowd.is_crowded or self.crowd.is_start_unsure:
            return f"most {VIEW_MOVED}" if self.crowd.is_crowded else f"some {VIEW_MOVED}"
        return OTHER_MOTION
