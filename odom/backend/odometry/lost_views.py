"""The newest views of a camera that is lost among moving bodies, and whether they show by themselves what is the scene.

Where two looks in a row tell how the camera moved, a segment may begin without waiting, with what stands still only.
"""

from dataclasses import dataclass

from odom.backend.mapping.tuning import TUNING
from odom.backend.odometry.tuning import TUNING as ODOMETRY
from odom.backend.tracking.motion_model import AT_REST
from odom.backend.tracking.scene_motion import scene_motion
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.view import View
from odom.frontend.matching.look_back import EarlierView
from odom.geometry import se3

_MOST_VIEWS = 8
"""Views kept, some 1 MB each."""
_APART_S = TUNING.spread_least_s / 4
"""Least time between two of them: of quick streams not every view is kept, so that one is always long enough ago."""


@dataclass(frozen=True, eq=False)
class LostViews:
    """The newest `views` that may still show how the camera moved, oldest first.

    `latest` is an earlier view and where it lies from the newest one, if that look showed the scene's motion; `scene`
    is the same if the look before showed it, too. Known places are looked for `patience` times as long as elsewhere
    before a segment begins.
    """

    views: tuple[View, ...] = ()
    latest: EarlierView | None = None
    scene: EarlierView | None = None
    patience: float = 1.0

    def after(self, view: View, sensor: SensorModel, in_doubt: bool) -> "LostViews":
        """Return what is known after one more view without a pose: nothing unless moving bodies left it `in_doubt`."""
        if not in_doubt:
            return LostViews()
        near = [one for one in self.views if 0.0 < view.since_s(one) <= TUNING.spread_most_s]
        apart = [one for one in near if view.since_s(one) >= TUNING.spread_least_s]
        kept = tuple(near) if near and view.since_s(near[-1]) < _APART_S else (*near, view)[-_MOST_VIEWS:]
        T_view_earlier = scene_motion(apart[-1], view, sensor) if apart else None
        if T_view_earlier is None:
            return LostViews(kept, patience=ODOMETRY.patience)
        latest = EarlierView(apart[-1], se3.inverse(T_view_earlier), AT_REST)
        if self.latest is None:
            return LostViews(kept, latest, patience=ODOMETRY.patience)
        return LostViews(kept, latest, latest, ODOMETRY.patience_with_scene)
