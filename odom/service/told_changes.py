"""Logs changes during a run: the camera is lost, it has recovered, or another calibration is used."""

import logging

from odom.backend import Estimate, Odometry, State
from odom.frame import Camera
from odom.service.final_results import latest_calibration

_LOG = logging.getLogger(__name__)


class ToldChanges:
    """Tells each change once."""

    def __init__(self) -> None:
        self._camera: Camera | None = None

    def state(self, before: Estimate | None, now: Estimate) -> None:
        """Log that the camera is lost, or no longer lost; `before` is the estimate of the frame before."""
        earlier = None if before is None else before.state
        if now.state is not earlier and State.LOST in (now.state, earlier):
            _LOG.info("frame %d: %s: %s", now.sequence, now.state.value, now.reason)

    def camera(self, odometry: Odometry, now: Estimate) -> None:
        """Log that frames are measured by another calibration than the one given, or that it changed again."""
        latest = latest_calibration(odometry)
        if latest is None or odometry.camera_in_use is self._camera:
            return
        self._camera = odometry.camera_in_use
        words = "frame %d: the calibration given is off by %.1f px; from here on it is tracked by one found on the way"
        _LOG.info(words, now.sequence, latest.off_px)
