"""OptiTrack: motion capture truth, live through NatNet or from a Motive CSV file."""

from pathlib import Path

from odom.errors import SourceError
from sensors.optitrack.settings import OptiTrackSettings
from sensors.source import Source, SourceOptions
from sensors.source_options import read_options


def open_optitrack(spec: str, options: SourceOptions) -> Source:
    """Open `optitrack:SERVER` (the machine that runs Motive) or a CSV file exported from Motive.

    `options.extra` holds the settings of `OptiTrackSettings`. Raises SourceError when the server does not answer or the
    file is not an export, ConfigError for an unknown setting.
    """
    from sensors.optitrack.source import MotiveFile, OptiTrackSource

    settings = read_options("optitrack", OptiTrackSettings, dict(options.extra))
    if spec.endswith(".csv"):
        return MotiveFile(Path(spec), settings)
    server = spec.partition(":")[2]
    if not server:
        raise SourceError("optitrack:SERVER: give the address of the machine that runs Motive")
    return OptiTrackSource(server, settings, options.seconds)
