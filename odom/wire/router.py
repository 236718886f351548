"""A router: a session that only passes messages on, and logs which clients it refused and why."""

import logging
import threading

from odom.wire.refused_clients import refused_clients_logged
from odom.wire.security import secured
from odom.wire.session import open_session
from odom.wire.settings import WireSettings

_LOG = logging.getLogger(__name__)


def run_router(settings: WireSettings, stop: threading.Event) -> None:
    """Route until `stop` is set; raises WireError when it cannot listen on one of its endpoints."""
    listening = secured(settings.listen, settings.security)
    encrypted = " (tls in place of tcp)" if listening != list(settings.listen) else ""
    with refused_clients_logged(), open_session(settings):
        by_rules = ", by rules" if settings.security.access else ""
        _LOG.info("routing at %s%s%s", ", ".join(listening), encrypted, by_rules)
        stop.wait()
