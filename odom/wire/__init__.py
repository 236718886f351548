"""Messages, keys, Zenoh sessions and MCAP recordings."""

from odom.wire.message import Message
from odom.wire.settings import LOCAL, WireSettings
from odom.wire.topics import TF, TRUTH, Topics, truth, truth_body

__all__ = ["LOCAL", "TF", "TRUTH", "Message", "Topics", "WireSettings", "truth", "truth_body"]
