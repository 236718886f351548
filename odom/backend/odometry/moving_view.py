"""How much of the view moves, judged some ten times a second, and whether that leaves the pose in doubt."""

from dataclasses import dataclass, replace

import numpy as np

from odom.backend.map.landmarks import Landmarks
from odom.backend.mapping.standing import RecentViews
from odom.backend.odometry.tuning import TUNING
from odom.backend.tracking.frame_state import Tracked
from odom.backend.tracking.other_motions import WhatElseMoves
from odom.backend.tracking.tuning import TUNING as TRACKING
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.camera.stamp_clock import SteadyStamp
from odom.frontend.features.view import View
from odom.frontend.matching.moving_surfaces import MovingCells
from odom.geometry.arrays import Array

VIEW_MOVED = "of the view moved"
"""The end of a frame's reason where it is UNCERTAIN for this alone."""


@dataclass(frozen=True, eq=False)
class MovingView:
    """What moves in the view that was looked at last, and whether that leaves the camera's pose in doubt.

    A camera that follows a moving body sees the scene move instead. Landmarks that were made when nothing was
    suspicious can tell that it does not. Their identities are running numbers: made before X means identity below X.

    - `stamp`: of that view. `cells`: what moves in it, None where nothing could tell.
    - `is_crowded`: most of the view moves, or did until lately. `calm`: since when it does not.
    - `begun`: the first look since the last loss. `is_young`: soon after it, a little that moves is enough for doubt,
      until landmarks from before agree with the pose.
    - `proven`: landmarks made before this identity were made when nothing was suspicious.
    - `rooted`: `proven` when the pose last became suspicious. `is_rooted`: landmarks made before that agree with it.
    - `is_astray`: the camera was lost in doubt, and may have taken a body for the place where it was found again.
    - `strayed`: when the corners of a key frame did not stand: a body is followed, or images are blurred or torn.
    - `other`: when another motion was last seen: a scene that the camera leaves behind moves as one.
    - `contender`: when another motion last had much of the votes. `rival`: when one had them twice within a second
      while no landmarks could tell, or once against those that could: a body may have been taken for the scene.
    - `spread`: covariance (6 x 6, SI) of the camera's velocity by what else moved lately, None without doubt or before
      anything told. The newest looks count most, but not alone: not each of them tells a body from the scene.
    - `is_left_behind`: it is another motion that the scene shows, so that the camera follows a body.
    - `fresh`: landmarks made since the camera was last found again have this identity or a larger one.
    - `confirmed`: so many looks showed that the camera follows the scene, and none since that it does not. `known`:
      after enough of them, landmarks made before this can tell as well; in a lasting crowd nothing is ever `proven`.
    - `doubted`: when the pose was last in doubt. `denied`: in so many looks in a row, soon after that, landmarks that
      can tell contradict the pose: it may follow a body that has just come into view.
    """

    stamp: SteadyStamp | None = None
    cells: MovingCells | None = None
    is_crowded: bool = False
    is_young: bool = False
    begun: SteadyStamp | None = None
    calm: SteadyStamp | None = None
    proven: int = 0
    strayed: SteadyStamp | None = None
    other: SteadyStamp | None = None
    contender: SteadyStamp | None = None
    rival: SteadyStamp | None = None
    is_astray: bool = False
    rooted: int = 0
    is_rooted: bool = False
    spread: Array | None = None
    is_left_behind: bool = False
    fresh: int = 0
    confirmed: int = 0
    known: int = 0
    doubted: SteadyStamp | None = None
    denied: int = 0

    def after(
        self, view: View, tracked: Tracked, recent: RecentViews, landmarks: Landmarks, sensor: SensorModel
    ) -> "MovingView":
        """Return what is known after a tracked `view`, compared with `recent` ones; unchanged unless a look is due."""
        stamp = view.steady_stamp
        if self.stamp is not None and abs(stamp - self.stamp) * 1e-9 < TUNING.moving_period_s:
            return self
        looked = self._looked(stamp, recent.moving(view, tracked, sensor), tracked, landmarks)
        rooted = looked.proven if looked.is_suspicious else self.rooted
        looked = replace(looked, rooted=rooted, is_rooted=rooted > 0 and is_supported(tracked, landmarks, rooted))
        is_unproven = looked.proven == 0 or looked.is_suspicious or is_contradicted(tracked, landmarks, looked.proven)
        looked = looked._with_others(recent.what_else_moves(view, tracked, sensor) if is_unproven else None)
        is_known = looked.confirmed > self.confirmed and looked.confirmed >= TUNING.confirmed_looks
        looked = replace(looked, known=landmarks.next_identity) if is_known else looked
        return replace(looked, doubted=stamp) if looked.is_doubtful else looked

    def _with_others(self, others: WhatElseMoves | None) -> "MovingView":
        """Return what is known after a look at which `others` move in the view (None: it could not tell)."""
        if others is None:
            seen = replace(self, is_left_behind=False)
            return seen if self.is_doubtful else replace(seen, spread=None)
        is_seen = self.is_suspicious and others.share > TUNING.moved_as_one
        seen = replace(self, other=self.stamp) if is_seen else self
        has_rival = others.share > TUNING.moved_rival
        seen = replace(seen, confirmed=0 if others.has_scene or has_rival else self.confirmed + others.is_confirmed)
        is_again = self._was_lately(self.contender, TUNING.moved_as_one_s)
        if has_rival and (self.denied or (is_again and self.trusted == 0)):
            seen = replace(seen, rival=self.stamp)
        is_behind = others.has_scene or (has_rival and self.denied >= TUNING.denied_looks)
        contender = self.stamp if has_rival else self.contender
        seen = replace(seen, contender=contender, is_left_behind=is_behind and not self.is_rooted)
        if not seen.is_doubtful:
            return replace(seen, spread=None)
        before = others.spread if self.spread is None else self.spread
        return replace(seen, spread=before + TUNING.spread_newest * (others.spread - before))

    def _looked(
        self, stamp: SteadyStamp, cells: MovingCells | None, tracked: Tracked, landmarks: Landmarks
    ) -> "MovingView":
        """Return what is known after a look at `stamp` that showed `cells`."""
        if cells is None:
            return replace(self, stamp=stamp, cells=None)
        strayed = self.strayed
        if strayed is not None and (
            (stamp - strayed) * 1e-9 >= TUNING.moved_parts_s
            or is_supported(tracked, landmarks, self.proven, TUNING.moved_support)
        ):
            strayed = None
        begun = stamp if self.begun is None else self.begun
        since_s, is_backed = (stamp - begun) * 1e-9, is_supported(tracked, landmarks, self.trusted)
        is_young = (
            since_s < TUNING.moving_young_s and not is_backed and (self.is_young or cells.share > TUNING.moving_little)
        )
        is_astray = self.is_astray and since_s < TUNING.moved_parts_s and not is_backed
        seen = replace(self, stamp=stamp, cells=cells, begun=begun, strayed=strayed)
        seen = replace(seen, is_young=is_young, is_astray=is_astray)
        seen = replace(seen, denied=self._denied(tracked, landmarks))
        if cells.share > TUNING.moving_most or seen.denied >= TUNING.denied_looks:
            return replace(seen, is_crowded=not is_backed, calm=None)
        calm = stamp if self.calm is None else self.calm
        is_calm = (stamp - calm) * 1e-9 >= TUNING.moving_calm_s
        seen = replace(seen, is_crowded=self.is_crowded and not (is_calm or is_backed), calm=calm)
        is_proven = is_calm and not (seen.is_suspicious or seen.denied)
        return replace(seen, proven=landmarks.next_identity) if is_proven else seen

    def _denied(self, tracked: Tracked, landmarks: Landmarks) -> int:
        """Return in how many looks in a row, up to this, landmarks that can tell contradict the pose soon after doubt.

        Where next to none of them is found, one look counts as several. Quick turns without people look the same.
        """
        was_doubtful = self._was_lately(self.doubted, TUNING.moved_parts_s)
        if not (was_doubtful and is_contradicted(tracked, landmarks, self.trusted)):
            return 0
        if is_contradicted(tracked, landmarks, self.trusted, TUNING.moved_denies):
            return max(self.denied + 1, TUNING.denied_looks)
        return self.denied + 1

    def _was_lately(self, then: SteadyStamp | None, within_s: float) -> bool:
        """Return whether `then` (None: never) was less than `within_s` before the newest look."""
        return then is not None and self.stamp is not None and (self.stamp - then) * 1e-9 < within_s

    def after_loss(self, next_identity: int = 0) -> "MovingView":
        """Return what is known where a segment begins or the camera is found again: looks are counted anew.

        Landmarks made from then on begin with `next_identity`. After a loss in doubt, a view that seems to stand still
        proves little: a body that is followed looks the same.
        """
        lost = replace(self, is_young=False, is_astray=self.is_doubtful, is_left_behind=False, fresh=next_identity)
        return replace(lost, stamp=None, cells=None, begun=None, calm=None, contender=None, rival=None, confirmed=0)

    def after_keyframe(
        self, stamp: SteadyStamp, moved_share: float, tracked: Tracked, landmarks: Landmarks
    ) -> "MovingView":
        """Return what is known after a key frame, of whose view a `moved_share` was seen to move by its corners."""
        is_strayed = moved_share > TUNING.moved_parts and not is_supported(tracked, landmarks, self.proven)
        return replace(self, strayed=stamp if is_strayed else None)

    @property
    def trusted(self) -> int:
        """Landmarks made before this identity can tell whether the camera follows a body; 0 where none can."""
        return max(self.proven, self.known)

    @property
    def is_suspicious(self) -> bool:
        """Whether the pose may be in doubt, so that it is worth looking for what else moves as one."""
        return self.is_crowded or self.is_young or self.is_astray or self.is_rivalled or self.strayed is not None

    @property
    def is_rivalled(self) -> bool:
        """Whether so much else moved as one lately that the camera may have followed a body from the start."""
        return self._was_lately(self.rival, TUNING.moved_as_one_s)

    @property
    def is_doubtful(self) -> bool:
        """Whether what moves leaves the pose in doubt."""
        if self.is_crowded or self.is_young or self.is_astray or self.is_rivalled or self.is_left_behind:
            return True
        return self.strayed is not None and self._was_lately(self.other, TUNING.moved_as_one_s)

    @property
    def doubt(self) -> str:
        """Why the pose is in doubt, empty where it is not."""
        if not self.is_doubtful:
            return ""
        if self.cells is None or self.calm is not None:
            return f"most {VIEW_MOVED}"
        return f"{self.cells.share:.0%} {VIEW_MOVED}"


def is_supported(tracked: Tracked, landmarks: Landmarks, proven: int, times: float = 1.0) -> bool:
    """Return whether landmarks made before identity `proven` agree with a pose.

    There must be enough that do, and at least `times` as many as those that should be in view and do not.
    """
    found, missed = _found_and_missed(tracked, landmarks, proven)
    return bool(found >= max(TRACKING.sure_inliers, times * missed))


def is_contradicted(
    tracked: Tracked, landmarks: Landmarks, proven: int, times: float = TUNING.moved_contradicts
) -> bool:
    """Return whether landmarks made before identity `proven` contradict a pose.

    There must be enough that should be in view and are missed, and at least `times` as many as are found.
    """
    found, missed = _found_and_missed(tracked, landmarks, proven)
    return bool(missed >= max(TRACKING.sure_inliers, times * found))


def _found_and_missed(tracked: Tracked, landmarks: Landmarks, proven: int) -> tuple[int, int]:
    found = int(np.count_nonzero(landmarks.identity[tracked.rows[tracked.inliers]] < proven))
    could_be_seen = ~(tracked.sight.hidden | tracked.sight.washed_out)
    missed = int(np.count_nonzero((landmarks.identity[tracked.missed] < proven) & could_be_seen))
    return found, missed
