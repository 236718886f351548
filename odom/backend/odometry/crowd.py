"""How much of the view moves, look by look: whether it is crowded or calm, and whether the pose is in doubt."""

from dataclasses import dataclass, replace

from odom.backend.odometry.tuning import TUNING
from odom.backend.odometry.witnesses import Agreement
from odom.frontend.camera.stamp_clock import SteadyStamp, is_within


@dataclass(frozen=True)
class Crowd:
    """How much has moved in the looks at the view so far.

    - `is_crowded`: most of the view moves, or did until lately. `calm_stamp`: since when it does not.
    - `moved_stamp`: when more than a little of it was last seen to move.
    - `first_stamp`: the first look since the last loss. `is_start_unsure`: a little moved soon after that, and since
      then no landmarks from before have agreed with the pose.
    - `is_recovery_unsure`: the camera was lost in doubt, and may have taken a body for the place where it was found.
    - `moved_keyframe_stamp`: a key frame whose corners did not stand: a body is followed, or images blurred or torn.
    """

    is_crowded: bool = False
    calm_stamp: SteadyStamp | None = None
    moved_stamp: SteadyStamp | None = None
    first_stamp: SteadyStamp | None = None
    is_start_unsure: bool = False
    is_recovery_unsure: bool = False
    moved_keyframe_stamp: SteadyStamp | None = None

    @property
    def is_doubtful(self) -> bool:
        """Whether so much moves that the pose is in doubt for this alone."""
        return self.is_crowded or self.is_start_unsure or self.is_recovery_unsure

    def is_calm(self, stamp: SteadyStamp) -> bool:
        """Return whether less than most of the view has moved for long enough, at `stamp`."""
        return self.calm_stamp is not None and not is_within(TUNING.moving_calm_s, self.calm_stamp, stamp)

    def after(self, stamp: SteadyStamp, share: float, trusted: Agreement, is_denied: bool) -> "Crowd":
        """Return what is known after a look at `stamp` in which a `share` of the view moves.

        `trusted` landmarks testify to the pose; `is_denied`: it is in doubt by them (see `Witnesses`).
        """
        first = stamp if self.first_stamp is None else self.first_stamp
        calm = stamp if self.calm_stamp is None else self.calm_stamp
        is_backed, is_most = trusted.supports(), share > TUNING.moving_most or is_denied
        has_moved = is_within(TUNING.moved_parts_s, self.moved_keyframe_stamp, stamp)
        has_moved = has_moved and not trusted.supports(TUNING.moved_support)
        seen = replace(self, first_stamp=first, calm_stamp=None if is_most else calm)
        seen = replace(seen, moved_stamp=stamp if share > TUNING.moving_seen else self.moved_stamp)
        seen = replace(seen, moved_keyframe_stamp=self.moved_keyframe_stamp if has_moved else None)
        if is_backed:
            return replace(seen, is_crowded=False, is_start_unsure=False, is_recovery_unsure=False)
        is_unsure = self.is_start_unsure or share > TUNING.moving_little
        return replace(
            seen,
            is_crowded=is_most or (self.is_crowded and not seen.is_calm(stamp)),
            is_start_unsure=is_unsure and is_within(TUNING.moving_young_s, first, stamp),
            is_recovery_unsure=self.is_recovery_unsure and is_within(TUNING.moved_parts_s, first, stamp),
        )
