"""OptiTrack: motion capture truth, live through NatNet or from a Motive CSV file."""

from pathlib import Path

from odom.errors import ConfigError
from sensors.optitrack.settings import OptiTrackSettings
from sensors.source import Source, SourceOptions
from sensors.source_options import read_options


def optitrack_settings(spec: str, options: SourceOptions) -> tuple[str, OptiTrackSettings]:
    """Return the server, empty for a CSV file, and the settings; raises ConfigError for what cannot be."""
    server = "" if spec.endswith(".csv") else spec.partition(":")[2]
    if not (server or spec.endswith(".csv")):
        raise ConfigError(f"{spec}: give optitrack:SERVER, the address of the machine that runs Motive")
    return server, read_options("optitrack", OptiTrackSettings, dict(options.extra))


def open_optitrack(spec: str, options: SourceOptions) -> Source:
    """Open `optitrack:SERVER` (the machine that runs Motive) or a CSV file exported from Motive.

    `options.extra` holds the settings of `OptiTrackSettings`. Raises SourceError when the server does not answer or the
    file is not an export, ConfigError as `optitrack_settings`.
    """
    from sensors.optitrack.source import MotiveFile, OptiTrackSource

    server, settings = optitrack_settings(spec, options)
    return OptiTrackSource(server, settings, options.seconds) if server else MotiveFile(Path(spec), settings)
