"""Calibrates during a run: frames from then on are tracked with the better calibration."""

import threading
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from odom.backend import Odometry
from odom.calibration.pixel_error import ray_sigma_px, significant_error_px
from odom.calibration.result import Calibrated
from odom.calibration.self_calibration import GOOD, SelfCalibration, better_camera
from odom.calibration.survey import Survey, surveyed
from odom.calibration.tuning import TUNING
from odom.errors import ConfigError, InputError
from odom.frame import Camera


@dataclass(frozen=True)
class Sureness:
    """By how much the camera in use seems to be off, and by how much the estimated one may be (px, over the image)."""

    off_px: float
    own_px: float

    @classmethod
    def of(cls, survey: Survey, found: Calibrated) -> "Sureness":
        """Return that of a calibration from a survey."""
        return cls(significant_error_px(survey.camera, found.camera, found.sigma, survey), ray_sigma_px(found))

    @property
    def is_enough(self) -> bool:
        """Whether the estimated camera may be used.

        Early in a walk estimates can be far off, and a wrong camera does more harm during a run than a slightly poor
        one; but the farther off the one in use is, the sooner an unsure one is better.
        """
        most_px = max(TUNING.change_unsure_px, self.off_px / TUNING.change_unsure_times)
        return self.own_px < most_px and self.off_px > TUNING.change_times * self.own_px

    @property
    def again(self) -> float:
        """How many times as long a walk is worth the next look.

        A somewhat longer one is likely to show that another camera is better where this one seems to be off; where it
        is surely good, only a much longer one may.
        """
        if self.off_px > TUNING.again_times * self.own_px:
            return TUNING.again_soon
        return TUNING.again_sure if self.own_px < TUNING.change_unsure_px else TUNING.again


class MidRunCalibrator:
    """Finds a better camera while an odometry runs, where the camera given to that is poor.

    It is used as `Odometry(camera, calibrator=MidRunCalibrator())`. `latest` is what it found last, None as long as
    the camera given is kept; `again` is what the last look says of the next one (see `Calibrator`).

    Its work waits until `ready` is set, since code that it needs may still be compiling (None: it is compiled when it
    is first used). Where frames cannot wait, as in a live stream (`may_wait()` is False), a look before that finds
    nothing; nor does it when `ready.wait()` gives up.
    """

    def __init__(self, ready: threading.Event | None = None, may_wait: Callable[[], bool] = lambda: True) -> None:
        self.latest: SelfCalibration | None = None
        self.again = TUNING.again
        if ready is None:
            ready = threading.Event()
            ready.set()
        self._ready, self._may_wait = ready, may_wait

    def wait(self) -> bool:
        """Wait until the work can be done; False when it never will be."""
        return self._ready.wait()

    def looked_at(self, odometry: Odometry) -> Callable[[], Camera | None]:
        """Return the work that finds a better camera in what was measured so far (see `Calibrator`)."""
        if not self._ready.is_set() and not self._may_wait():
            return lambda: None
        try:
            survey, given = surveyed(odometry)[0], odometry.camera
        except (InputError, ConfigError, np.linalg.LinAlgError):
            return lambda: None

        asked: list[Sureness] = []

        def is_sure(found: Calibrated) -> bool:
            asked.append(Sureness.of(survey, found))
            return asked[-1].is_enough

        def work() -> Camera | None:
            if not self.wait():
                return None
            try:
                found = better_camera(survey, given, is_sure)
                if asked:
                    self.again = asked[-1].again
                else:
                    self.again = TUNING.again if found.reason == GOOD else TUNING.again_soon
            except (InputError, ConfigError, np.linalg.LinAlgError):
                return None
            if found.found is None:
                return None
            self.latest = found
            return found.found.camera

        return work
