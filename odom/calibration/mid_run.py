"""Calibrates during a run: frames from then on are tracked with the better calibration."""

import threading
from collections.abc import Callable

import numpy as np

from odom.backend import Odometry
from odom.calibration.pixel_error import ray_sigma_px, significant_error_px
from odom.calibration.result import Calibrated
from odom.calibration.self_calibration import SelfCalibration, judged
from odom.calibration.survey import Survey, surveyed
from odom.calibration.tuning import TUNING
from odom.errors import ConfigError, InputError
from odom.frame import Camera


def is_sure(survey: Survey, found: Calibrated) -> bool:
    """Return whether the error of the camera in use is several times the uncertainty of the estimated one.

    Early in a walk estimates can be far off, and a wrong camera does more harm during a run than a slightly poor one.
    """
    own_px = ray_sigma_px(found)
    off_px = significant_error_px(survey.camera, found.camera, found.sigma, survey)
    return own_px < TUNING.change_unsure_px and off_px > TUNING.change_times * own_px


class MidRunCalibrator:
    """A calibrator for an `Odometry`; `latest` is what it found last, None as long as the camera given is kept.

    Its work waits until `ready` is set, since code that it needs may still be compiling (None: it is compiled when it
    is first used). Where frames cannot wait, as in a live stream (`may_wait()` is False), a look before that finds
    nothing.
    """

    def __init__(self, ready: threading.Event | None = None, may_wait: Callable[[], bool] = lambda: True) -> None:
        self.latest: SelfCalibration | None = None
        if ready is None:
            ready = threading.Event()
            ready.set()
        self._ready, self._may_wait = ready, may_wait

    def wait(self) -> None:
        """Wait until the work can be done."""
        self._ready.wait()

    def looked_at(self, odometry: Odometry) -> Callable[[], Camera | None]:
        """Return the work that finds a better camera in what was measured so far (see `Calibrator`)."""
        if not self._ready.is_set() and not self._may_wait():
            return lambda: None
        try:
            survey, given = surveyed(odometry)[0], odometry.camera
        except (InputError, ConfigError, np.linalg.LinAlgError):
            return lambda: None

        def work() -> Camera | None:
            self.wait()
            try:
                found = judged(survey, given, lambda found: is_sure(survey, found))
            except (InputError, ConfigError, np.linalg.LinAlgError):
                return None
            if found.found is None:
                return None
            self.latest = found
            return found.found.camera

        return work
