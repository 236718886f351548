"""An optional hook: a user's calibrator looks at what was measured so far, and may find a better camera in mid-run."""

from collections.abc import Callable
from typing import Generic, Protocol, TypeVar

from odom.backend.mapping.background import Background
from odom.backend.odometry.tuning import TUNING
from odom.frame import Camera
from odom.frontend.camera.stamp_clock import SteadyStamp, later

LookedAt = TypeVar("LookedAt", contravariant=True)
"""What a calibrator looks at: the odometry, which stands above this module."""


class Calibrator(Protocol[LookedAt]):
    """Looks at an odometry after certain numbers of frames, whatever the clock says.

    A look that has found nothing is worth repeating once `again` times as many frames have been measured.
    """

    @property
    def again(self) -> float:
        """More than 1; it may change during a look only."""
        ...

    def looked_at(self, odometry: LookedAt, /) -> Callable[[], Camera | None]:
        """Return work for the background that finds a better camera than the one in use, or None.

        What it needs of the odometry is copied here. The work must be deterministic.
        """
        ...


class Recalibration(Generic[LookedAt]):
    """Asks a calibrator each time enough more frames have been measured, until it finds a better camera.

    `in_use` is the camera that frames are measured by.
    """

    def __init__(self, given: Camera, calibrator: Calibrator[LookedAt] | None) -> None:
        self.in_use = self._to_come = given
        self._calibrator = calibrator
        self._background = Background[Camera | None]("calibration")
        self._looked_at = 0

    def adopt(self) -> None:
        """Note that the camera found last is in use from now on."""
        self.in_use = self._to_come

    def after_frame(self, odometry: LookedAt, measured: int, count: int, stamp: SteadyStamp) -> Camera | None:
        """Return a better camera that was found, after frame `count`; None to keep the one in use.

        `measured` frames of the odometry have kept their measurements so far.
        """
        if self._background.is_busy:
            found = self._background.take(count, stamp)
            if found is not None:
                self._to_come, self._calibrator = found, None
            return found
        if self._calibrator is None:
            return None
        due = max(TUNING.calibrate_least, self._calibrator.again * self._looked_at)
        if due <= measured <= TUNING.calibrate_most:
            self._looked_at = measured
            share = measured // TUNING.calibrate_least  # more frames to look at get more time
            by = later(stamp, share * TUNING.calibrate_s)
            self._background.start(count + share * TUNING.calibrate_frames, by, self._calibrator.looked_at(odometry))
        return None
