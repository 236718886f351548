"""New corners of a key frame, looked for while the next frames pass: those that stand still become landmarks."""

from dataclasses import dataclass, replace

import numpy as np

from odom.backend.map.corners import Corners
from odom.backend.mapping.background import Background
from odom.backend.mapping.standing import ComparedView
from odom.backend.mapping.tuning import TUNING
from odom.backend.settings import OdometrySettings
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.camera.stamp_clock import later
from odom.frontend.features.corners import detect_corners
from odom.frontend.features.lens_change import LensChange
from odom.frontend.features.measurement import measure_exactly
from odom.frontend.features.view import View
from odom.geometry.arrays import Array


@dataclass(frozen=True, eq=False)
class CornerSearch:
    """Key frame number `keyframe`, whose new corners are looked for; its `compared` view tells what stands still.

    Its corners are measured by `sensor` in motion with `twist` (6, SI). Moving bodies may leave its pose `in_doubt`.
    """

    keyframe: int
    compared: ComparedView
    twist: Array
    sensor: SensorModel
    in_doubt: bool


@dataclass(frozen=True, eq=False)
class FoundCorners:
    """New corners that a `search` found, and the share of the view in which most corners had moved."""

    search: CornerSearch
    corners: Corners
    moved_share: float


class NewCorners:
    """Looks for the new corners of one key frame at a time, in the background."""

    def __init__(self, settings: OdometrySettings) -> None:
        self._settings = settings
        self._background = Background[tuple[Array, float]]("corners")
        self._search: CornerSearch | None = None

    @property
    def are_coming(self) -> bool:
        """Whether corners are looked for that have not been taken yet."""
        return self._search is not None

    def first(self, view: View, uv_known: Array, twist: Array, sensor: SensorModel) -> Corners:
        """Return corners away from the landmarks at `uv_known` (m x 2 px), whether they move or not.

        Those without depth are left out unless the others are few.
        """
        images, cell_px = view.images, self._settings.cell_px
        uv = detect_corners(images.full, uv_known, cell_px, images.enlarged_from)
        if len(uv_known) + len(uv) < TUNING.corners_enough:
            uv = detect_corners(images.full, uv_known, cell_px // 2, images.enlarged_from)
        corners = _measured(view, uv[view.stands(uv)], twist, sensor)
        has_depth = corners.has_depth
        are_few = len(uv_known) + np.count_nonzero(has_depth) < TUNING.corners_enough
        return corners if are_few else corners.take(has_depth)

    def look_for(self, search: CornerSearch, count: int) -> None:
        """Begin to look for the corners of a key frame, which was frame number `count`."""
        compared = search.compared

        def work() -> tuple[Array, float]:
            corners = self.first(compared.view, compared.tracked.inlier_landmarks.uv, search.twist, search.sensor)
            stands, moved_share = compared.standing(corners, search.sensor, search.in_doubt)
            return corners.uv[stands], moved_share

        due_stamp = later(compared.view.steady_stamp, TUNING.corners_s)
        self._search = search
        self._background.start(count + self._settings.background_delay_frames, due_stamp, work)

    def remeasure(self, twist: Array, sensor: SensorModel) -> None:
        """Use `twist` (6, SI), which is known better now, to measure corners that are still looked for."""
        if self._search is not None:
            self._search = replace(self._search, twist=twist, sensor=sensor)

    def change_lens(self, change: LensChange) -> None:
        """Use a new lens to measure corners that are still looked for."""
        if self._search is not None:
            self._search = replace(self._search, sensor=self._search.sensor.with_lens(change.after))

    def take(self, count: int | None, sensor: SensorModel) -> FoundCorners | None:
        """Return what was found if the frame after number `count` needs it (None: at once), None where nothing is due.

        `sensor` has the clock of frame `count`: it tells when the next one is to be expected.
        """
        search = self._search
        expected = later(sensor.clock.steady, sensor.clock.period_s)
        found = self._background.take(count, expected)
        if search is None or found is None:
            return None
        self._search = None
        uv, moved_share = found
        return FoundCorners(search, _measured(search.compared.view, uv, search.twist, search.sensor), moved_share)


def _measured(view: View, uv: Array, twist: Array, sensor: SensorModel) -> Corners:
    """Return the corners at `uv` (n x 2 px) as measured, without a depth where it tells too little."""
    measured = measure_exactly(view, sensor, uv, twist)
    measured.values[~(measured.values[:, 2] > 1.0 / TUNING.farthest_m), 2] = np.nan
    return Corners(uv, measured)
