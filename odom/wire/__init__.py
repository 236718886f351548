"""Messages, keys, Zenoh sessions and MCAP recordings."""

from odom.wire.message import Message
from odom.wire.settings import LOCAL, WireSettings
from odom.wire.topics import TF, TRUTH, TRUTH_HISTORY, Topics, truth, truth_body, truth_history

__all__ = [
    "LOCAL",
    "TF",
    "TRUTH",
    "TRUTH_HISTORY",
    "Message",
    "Topics",
    "WireSettings",
    "truth",
    "truth_body",
    "truth_history",
]
