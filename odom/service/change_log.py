"""Logs changes during a run: the camera is lost, it has recovered, or another calibration is used."""

import logging

from odom.backend import Estimate, Odometry, State
from odom.frame import Camera
from odom.service.run_calibration import latest_calibration

_LOG = logging.getLogger(__name__)
_OTHER_CALIBRATION = (
    "frame %d: the calibration given is off by %.1f px; from here on it is tracked by one found on the way"
)


class ChangeLog:
    """Logs each change once."""

    def __init__(self) -> None:
        self._camera: Camera | None = None

    def note(self, odometry: Odometry, before: Estimate | None, now: Estimate) -> None:
        """Log what is other with the estimate of a frame than with that of the frame `before`."""
        earlier = None if before is None else before.state
        if now.state is not earlier and State.LOST in (now.state, earlier):
            _LOG.info("frame %d: %s: %s", now.sequence, now.state.value, now.reason)
        latest = latest_calibration(odometry)
        if latest is not None and odometry.camera_in_use is not self._camera:
            self._camera = odometry.camera_in_use
            _LOG.info(_OTHER_CALIBRATION, now.sequence, latest.off_px)
