"""Cameras of ROS 2 as sources: whatever driver publishes colour, depth and calibration, found by their types."""

from odom.errors import ConfigError
from sensors.ros2.settings import Ros2Settings
from sensors.source import Source, SourceOptions
from sensors.source_options import read_options


def ros2_settings(spec: str, options: SourceOptions) -> tuple[str, Ros2Settings]:
    """Return the prefix of the topics of `ros2:/camera` and the settings; raises ConfigError for what cannot be."""
    prefix = "/" + spec.partition(":")[2].strip("/")
    if not all(part.isidentifier() and part.isascii() for part in prefix.strip("/").split("/") if prefix != "/"):
        raise ConfigError(f"{spec}: give ros2:/NAME, the beginning of the camera's topics, as in ros2:/camera")
    return prefix, read_options("ros2", Ros2Settings, dict(options.extra))


def open_ros2(spec: str, options: SourceOptions) -> Source:
    """Open `ros2:/camera`, the topics below that name.

    Raises SourceError, with what to do, when images or calibration do not come, ConfigError when they cannot be used.
    """
    prefix, settings = ros2_settings(spec, options)
    from sensors.ros2.source import Ros2Source

    return Ros2Source(prefix, settings, options)
