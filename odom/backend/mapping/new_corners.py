"""New corners of a key frame, looked for while the next frames pass: those that stand still become landmarks."""

from dataclasses import dataclass, replace

from odom.backend.map.map import Corners
from odom.backend.mapping.background import Background
from odom.backend.mapping.standing import Before
from odom.backend.mapping.tuning import TUNING
from odom.backend.settings import OdometrySettings
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.camera.stamp_clock import SteadyStamp
from odom.frontend.features.corners import detect_corners
from odom.frontend.features.lens_change import LensChange
from odom.frontend.features.measurement import measure_exactly
from odom.frontend.features.view import View
from odom.geometry.arrays import Array


@dataclass(frozen=True, eq=False)
class Wanted:
    """Key frame number `keyframe`, whose new corners are looked for; `before` tells what stands still in it.

    Its corners are measured by `sensor` in motion with `twist` (6, SI). Moving bodies may leave its pose `in_doubt`.
    """

    keyframe: int
    before: Before
    twist: Array
    sensor: SensorModel
    in_doubt: bool


@dataclass(frozen=True, eq=False)
class Grown:
    """New corners of the key frame that was `wanted`, and the share of its view in which most corners had moved."""

    wanted: Wanted
    corners: Corners
    moved_share: float


class NewCorners:
    """Looks for the new corners of one key frame at a time, in the background."""

    def __init__(self, settings: OdometrySettings) -> None:
        self._settings = settings
        self._background = Background[tuple[Array, float]]("corners")
        self._wanted: Wanted | None = None

    @property
    def are_coming(self) -> bool:
        """Whether corners are looked for that have not been taken yet."""
        return self._wanted is not None

    def first(self, view: View, uv_known: Array, twist: Array, sensor: SensorModel) -> Corners:
        """Return corners with depth away from the landmarks at `uv_known` (m x 2 px), whether they move or not."""
        images, cell_px = view.images, self._settings.cell_px
        uv = detect_corners(images.full, uv_known, cell_px, images.enlarged_from)
        if len(uv_known) + len(uv) < TUNING.corners_enough:
            uv = detect_corners(images.full, uv_known, cell_px // 2, images.enlarged_from)
        return _with_depth(view, uv[view.stands(uv)], twist, sensor)

    def look_for(self, wanted: Wanted, count: int) -> None:
        """Begin to look for the corners of a key frame, which was frame number `count`."""
        before, view = wanted.before, wanted.before.view

        def work() -> tuple[Array, float]:
            corners = self.first(view, before.tracked.inlying.uv, wanted.twist, wanted.sensor)
            stands, moved_share = before.standing(corners, wanted.sensor, wanted.in_doubt)
            return corners.uv[stands], moved_share

        due_stamp = SteadyStamp(view.steady_stamp + round(TUNING.corners_s * 1e9))
        self._wanted = wanted
        self._background.start(count + self._settings.background_delay_frames, due_stamp, work)

    def remeasure(self, twist: Array, sensor: SensorModel) -> None:
        """Use `twist` (6, SI), which is known better now, to measure corners that are still looked for."""
        if self._wanted is not None:
            self._wanted = replace(self._wanted, twist=twist, sensor=sensor)

    def see_through(self, change: LensChange) -> None:
        """Use a new lens to measure corners that are still looked for."""
        if self._wanted is not None:
            self._wanted = replace(self._wanted, sensor=self._wanted.sensor.with_lens(change.after))

    def take(self, count: int | None, sensor: SensorModel) -> Grown | None:
        """Return what was found if the frame after number `count` needs it (None: at once), None where nothing is due.

        `sensor` has the clock of frame `count`: it tells when the next one is to be expected.
        """
        wanted = self._wanted
        expected = SteadyStamp(sensor.clock.steady + round(sensor.clock.period_s * 1e9))
        found = self._background.take(count, expected)
        if wanted is None or found is None:
            return None
        self._wanted = None
        uv, moved_share = found
        return Grown(wanted, _with_depth(wanted.before.view, uv, wanted.twist, wanted.sensor), moved_share)


def _with_depth(view: View, uv: Array, twist: Array, sensor: SensorModel) -> Corners:
    """Return those of the corners at `uv` (n x 2 px) that have depth."""
    measured = measure_exactly(view, sensor, uv, twist)
    return Corners(uv, measured).take(measured.values[:, 2] > 1.0 / TUNING.farthest_m)
