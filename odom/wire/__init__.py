"""Messages, keys, Zenoh sessions and MCAP recordings."""

from odom.wire.message import Message as Message
from odom.wire.settings import LOCAL as LOCAL
from odom.wire.settings import WireSettings as WireSettings
from odom.wire.topics import TF as TF
from odom.wire.topics import TRUTH as TRUTH
from odom.wire.topics import TRUTH_HISTORY as TRUTH_HISTORY
from odom.wire.topics import Topics as Topics
from odom.wire.topics import truth as truth
from odom.wire.topics import truth_body as truth_body
from odom.wire.topics import truth_history as truth_history
