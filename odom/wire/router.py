"""A router: a session that only passes messages on, and tells in the log whom it turned away."""

import logging
import threading

from odom.wire.refusals import refusals_logged
from odom.wire.session import open_session
from odom.wire.settings import WireSettings

log = logging.getLogger(__name__)


def run_router(settings: WireSettings, stop: threading.Event) -> None:
    """Route until `stop` is set."""
    with refusals_logged(), open_session(settings):
        log.info("routing at %s%s", ", ".join(settings.listen), ", by rules" if settings.security.access else "")
        stop.wait()
