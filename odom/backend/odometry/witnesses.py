"""Landmarks that are old enough to tell whether the camera follows the scene or a body, and what they say of a pose."""

from dataclasses import dataclass, replace

import numpy as np

from odom.backend.map.landmarks import Landmarks
from odom.backend.odometry.tuning import TUNING
from odom.backend.tracking.tracked_frame import TrackedFrame
from odom.backend.tracking.tuning import TUNING as TRACKING
from odom.geometry.arrays import Index, Mask


@dataclass(frozen=True)
class Agreement:
    """How old landmarks agree with a pose: it `found` so many, and `missed` so many that it should see unhindered."""

    found: int
    missed: int

    @classmethod
    def of(cls, tracked: TrackedFrame, landmarks: Landmarks, identity: int) -> "Agreement":
        """Return how the landmarks with identities below `identity` agree with a `tracked` frame's pose.

        Those that have departed do not tell.
        """
        found = cls._telling(landmarks, tracked.rows[tracked.inliers], identity)
        could_be_seen = ~(tracked.sight.hidden | tracked.sight.washed_out)
        missed = cls._telling(landmarks, tracked.missed, identity) & could_be_seen
        return cls(int(np.count_nonzero(found)), int(np.count_nonzero(missed)))

    @staticmethod
    def _telling(landmarks: Landmarks, rows: Index, identity: int) -> Mask:
        """Return which landmarks (n) have an identity below `identity`, and have not departed."""
        return (landmarks.identity.take(rows) < identity) & ~landmarks.departed.take(rows)

    def testifies(self) -> bool:
        """Return whether enough of them should be seen to tell: of another place or segment, none are."""
        return self.found + self.missed >= TRACKING.sure_inliers

    def supports(self, times: float = 1.0) -> bool:
        """Return whether the pose found enough of them, and at least `times` as many as it missed."""
        return self.found >= max(TRACKING.sure_inliers, times * self.missed)

    def contradicts(self, times: float = TUNING.moved_contradicts) -> bool:
        """Return whether the pose missed enough of them, and at least `times` as many as it found."""
        return self.missed >= max(TRACKING.sure_inliers, times * self.found)


@dataclass(frozen=True)
class Witnesses:
    """Which landmarks can tell whether the camera follows the scene. Identities are running numbers, in order of age.

    - Those below `proven_identity` were made when nothing was suspicious.
    - Those below `known_identity` were made before enough looks had shown that the camera follows the scene: in a
      lasting crowd nothing is ever proven. `confirming_looks` counts such looks since the last that spoke against it.
    - Those below `rooted_identity` were proven when the pose last became suspicious; `is_rooted`: they agree with it.
    - Those from `fresh_identity` on were made since the camera was last found again, or its segment began (0).
    - `denying_looks`: in so many looks in a row, soon after a doubt, trusted ones contradict the pose. The camera may
      follow a body that has just come into view.
    """

    proven_identity: int = 0
    known_identity: int = 0
    rooted_identity: int = 0
    fresh_identity: int = 0
    is_rooted: bool = False
    confirming_looks: int = 0
    denying_looks: int = 0

    @property
    def trusted_identity(self) -> int:
        """Landmarks below this identity can tell whether the camera follows a body; 0 where none can."""
        return max(self.proven_identity, self.known_identity)

    @property
    def unproven_identity(self) -> int:
        """Landmarks from this identity on may lie on the body that the camera follows: not those that deny it."""
        return max(self.trusted_identity if self.is_denied else self.proven_identity, self.fresh_identity)

    @property
    def is_denied(self) -> bool:
        """Whether the pose is in doubt since they contradict it."""
        return self.denying_looks >= TUNING.denied_looks

    def with_testimony(self, trusted: Agreement, is_after_doubt: bool) -> "Witnesses":
        """Return the witnesses after a look, soon after a doubt or not, in which the `trusted` ones testified.

        Where next to none of them is found, one look counts as several. Otherwise one is not enough, since a quick turn
        without people looks the same.
        """
        if not (is_after_doubt and trusted.contradicts()):
            return replace(self, denying_looks=0)
        least = TUNING.denied_looks if trusted.contradicts(TUNING.moved_denies) else 1
        return replace(self, denying_looks=max(self.denying_looks + 1, least))

    def with_root(self, tracked: TrackedFrame, landmarks: Landmarks, is_suspicious: bool) -> "Witnesses":
        """Return the witnesses after a look at a `tracked` frame whose pose is suspicious, or is not."""
        root = self.proven_identity if is_suspicious else self.rooted_identity
        is_rooted = root > 0 and Agreement.of(tracked, landmarks, root).supports()
        return replace(self, rooted_identity=root, is_rooted=is_rooted)

    def with_confirmation(self, is_confirmed: bool, is_disputed: bool, next_identity: int) -> "Witnesses":
        """Return the witnesses after a look that showed that the camera follows the scene, or perhaps does not."""
        looks = 0 if is_disputed else self.confirming_looks + is_confirmed
        is_known = looks > self.confirming_looks and looks >= TUNING.confirmed_looks
        known = next_identity if is_known else self.known_identity
        return replace(self, confirming_looks=looks, known_identity=known)
