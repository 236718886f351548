"""Which motions beside the camera's were seen in the view lately, and whether one of them is rather the scene's."""

from dataclasses import dataclass, replace

from odom.backend.odometry.tuning import TUNING
from odom.backend.odometry.witnesses import Agreement, Witnesses
from odom.backend.tracking.other_motions import WhatElseMoves
from odom.frontend.camera.stamp_clock import SteadyStamp, is_within
from odom.geometry.arrays import Array


@dataclass(frozen=True, eq=False)
class RivalMotions:
    """When other motions were last seen: a scene that the camera leaves behind moves as one.

    - `seen_stamp`: when any was, while the pose was suspicious. `large_stamp`: when one had much of the votes, of which
      fewer are enough behind what moves with the camera.
    - `rival_stamp`: when one had them twice within a second while no landmarks could tell, or once against those that
      could: a body may have been taken for the scene.
    - `is_left_behind`: the scene shows another motion than the camera's, which therefore follows a body.
    - `spread`: covariance (6 x 6, (m/s, rad/s)^2, camera frame) of the camera's velocity by what else moved lately,
      None without doubt or before the first look that showed it. The newest looks count most, but not alone: not each
      of them tells a body from the scene.
    """

    seen_stamp: SteadyStamp | None = None
    large_stamp: SteadyStamp | None = None
    rival_stamp: SteadyStamp | None = None
    is_left_behind: bool = False
    spread: Array | None = None

    def is_rivalled(self, stamp: SteadyStamp | None) -> bool:
        """Return whether a body may have been taken for the scene, by the looks shortly before `stamp`."""
        return is_within(TUNING.moved_as_one_s, self.rival_stamp, stamp)

    def after(
        self,
        stamp: SteadyStamp,
        others: WhatElseMoves,
        witnesses: Witnesses,
        trusted: Agreement,
        is_suspicious: bool,
        is_warned: bool,
    ) -> "RivalMotions":
        """Return what is known after a look at `stamp` that showed which `others` there are; `spread` stays.

        `trusted`: how the landmarks that can tell agree with the pose, if enough of them are in view to speak for it.
        Where nothing else warned (`is_warned`), the scene must be seen to move away twice.
        """
        is_seen = is_suspicious and others.share > TUNING.moved_as_one
        is_large = others.share > TUNING.moved_rival or others.behind > TUNING.moved_behind
        is_second = is_within(TUNING.moved_as_one_s, self.large_stamp, stamp)
        is_rival = is_large and (witnesses.denying_looks > 0 or (is_second and not trusted.testifies()))
        is_denied = (is_large and witnesses.is_denied) or (is_rival and others.is_denied)
        seen = replace(self, seen_stamp=stamp) if is_seen else self
        seen = replace(seen, large_stamp=stamp) if is_large else seen
        seen = replace(seen, rival_stamp=stamp) if is_rival else seen
        is_scene = others.has_scene and (is_warned or is_second)
        return replace(seen, is_left_behind=is_scene or (is_denied and not witnesses.is_rooted))

    def with_spread(self, others: WhatElseMoves | None, is_doubtful: bool) -> "RivalMotions":
        """Return the same with the `spread` after a look that showed `others` (None: it could not tell)."""
        if others is None or not is_doubtful:
            return self if is_doubtful else replace(self, spread=None)
        before = others.spread if self.spread is None else self.spread
        return replace(self, spread=before + TUNING.spread_newest * (others.spread - before))
