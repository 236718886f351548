"""Messages, keys, Zenoh sessions and MCAP recordings."""

from odom.wire.message import Message
from odom.wire.topics import TF, TRUTH, Topics, truth

__all__ = ["TF", "TRUTH", "Message", "Topics", "truth"]
