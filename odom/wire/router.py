"""A router: a session that only passes messages on, and tells in the log whom it turned away."""

import logging
import threading

from odom.wire.refusals import refusals_logged
from odom.wire.security import secured
from odom.wire.session import open_session
from odom.wire.settings import WireSettings

log = logging.getLogger(__name__)


def run_router(settings: WireSettings, stop: threading.Event) -> None:
    """Route until `stop` is set; raises WireError when one of the endpoints to listen on cannot be had."""
    listening = secured(settings.listen, settings.security)
    encrypted = " (tls in place of tcp)" if listening != list(settings.listen) else ""
    with refusals_logged(), open_session(settings):
        by_rules = ", by rules" if settings.security.access else ""
        log.info("routing at %s%s%s", ", ".join(listening), encrypted, by_rules)
        stop.wait()
