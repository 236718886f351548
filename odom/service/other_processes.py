"""Who else is on the device, as the odometry sees it: the sensor, consumers, and others that do the same job."""

import logging

from odom.service.frame_receiver import FrameReceiver
from odom.wire import Topics
from odom.wire.namesakes import JOBS, Namesakes
from odom.wire.session import WireSession

_LOG = logging.getLogger(__name__)


class OtherProcesses:
    """Logs who comes and goes; by the `receiver` it knows whether the sensor is expected to go."""

    def __init__(self, session: WireSession, topics: Topics, receiver: FrameReceiver) -> None:
        self._alive, self._receiver = topics.alive, receiver
        self._sensor = ""
        session.watch(f"{topics.alive}/**", self._changed)
        self._jobs = [Namesakes(session, topics, role, _LOG.warning, is_one=role == "odometry") for role in JOBS]

    def status(self) -> dict[str, str]:
        """Return the values of a status message: whether the sensor is here, and what conflicts."""
        known = (*(namesakes.conflict for namesakes in self._jobs), self._receiver.conflict)
        conflicts = [conflict for conflict in known if conflict]
        return {"sensor": self._sensor} | ({"conflict": "; ".join(conflicts)} if conflicts else {})

    def _changed(self, key: str, alive: bool) -> None:
        role = key.removeprefix(self._alive).strip("/") or "sensor"
        if role == "odometry" or "/" in role:
            return
        expected = alive or self._receiver.source_ended
        _LOG.log(logging.INFO if expected else logging.WARNING, "%s is %s", role, "here" if alive else "gone")
        if role == "sensor":
            self._sensor = "here" if alive else "gone"
