"""How much of the view moves, looked at some ten times a second, and whether that leaves the pose in doubt."""

from dataclasses import dataclass

from odom.backend.mapping.standing import RecentViews
from odom.backend.odometry.tuning import TUNING
from odom.backend.tracking.frame_state import Tracked
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.camera.stamp_clock import SteadyStamp
from odom.frontend.features.view import View
from odom.frontend.matching.moving_surfaces import MovingCells

VIEW_MOVES = "of the view moves"
"""How the reason of a frame ends that is UNCERTAIN for this alone."""


@dataclass(frozen=True, eq=False)
class MovingView:
    """What moves in the newest view that was looked at, taken at `stamp`; `cells` is None where nothing could tell.

    `is_doubtful` from when most of the view moves, or seems to, until hardly anything does: a camera that was taken
    along by what moves sees the scene move instead.
    """

    stamp: SteadyStamp | None = None
    cells: MovingCells | None = None
    is_doubtful: bool = False

    def after(self, view: View, tracked: Tracked, recent: RecentViews, sensor: SensorModel) -> "MovingView":
        """Return what is known after a tracked `view`, by the `recent` ones: the same, unless it is time to look."""
        stamp = view.steady_stamp
        if self.stamp is not None and abs(stamp - self.stamp) * 1e-9 < TUNING.moving_period_s:
            return self
        cells = recent.moving(view, tracked, sensor)
        if cells is None:
            return MovingView(stamp, None, self.is_doubtful)
        most = TUNING.moving_little if self.is_doubtful else TUNING.moving_most
        return MovingView(stamp, cells, cells.share > most)

    @property
    def doubt(self) -> str:
        """Why the pose is in doubt, empty where it is not."""
        if not self.is_doubtful:
            return ""
        return "most of the view moved" if self.cells is None else f"{self.cells.share:.0%} {VIEW_MOVES}"
