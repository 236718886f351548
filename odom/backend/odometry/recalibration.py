"""An optional hook: someone's calibrator looks at what was measured so far, and may find another camera in mid-run."""

from collections.abc import Callable
from typing import Generic, Protocol, TypeVar

from odom.backend.mapping.background import Background
from odom.backend.odometry.tuning import TUNING
from odom.frame import Camera
from odom.frontend.camera.stamp_clock import SteadyStamp

LookedAt = TypeVar("LookedAt", contravariant=True)
"""What a calibrator looks at: the odometry, which stands above this module."""


class Calibrator(Protocol[LookedAt]):
    """Looks at an odometry at certain frames, whose number does not depend on the clock.

    `again` says, once a look has found nothing, after how many times as many frames another one is worth its cost.
    """

    @property
    def again(self) -> float:
        """More than 1; it must not change while nothing is looked at."""
        ...

    def looked_at(self, odometry: LookedAt, /) -> Callable[[], Camera | None]:
        """Return work for the background that finds a better camera than the one in use, or None.

        What it needs of the odometry is copied here. The work must be deterministic.
        """
        ...


class Recalibration(Generic[LookedAt]):
    """Asks a calibrator whenever so many more frames were measured as it wants, until it finds something.

    `in_use` is the camera that frames are measured by.
    """

    def __init__(self, given: Camera, calibrator: Calibrator[LookedAt] | None = None) -> None:
        self.in_use = self._to_come = given
        self._calibrator = calibrator
        self._background = Background[Camera | None]("calibration")
        self._looked_at = 0

    def adopt(self) -> None:
        """Note that what was found last is in use from now on."""
        self.in_use = self._to_come

    def after_frame(self, odometry: LookedAt, measured: int, count: int, stamp: SteadyStamp) -> Camera | None:
        """Return the camera to go on with after frame `count`, as soon as that can be; None to stay with what is.

        So far `measured` frames of the odometry have kept what they measured.
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
            share = measured // TUNING.calibrate_least  # what takes longer the more there is to look at has longer
            by = SteadyStamp(stamp + round(share * TUNING.calibrate_s * 1e9))
            self._background.start(count + share * TUNING.calibrate_frames, by, self._calibrator.looked_at(odometry))
        return None
