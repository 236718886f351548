"""OptiTrack: motion capture truth, live through NatNet or from a Motive CSV file."""

from pathlib import Path

from sensors.optitrack.settings import optitrack_settings
from sensors.source import Source, SourceOptions


def open_optitrack(spec: str, options: SourceOptions) -> Source:
    """Open `optitrack:SERVER` (the machine that runs Motive) or a CSV file exported from Motive.

    `options.extra` holds the settings of `OptiTrackSettings`. Raises SourceError when the server does not answer or the
    file is not an export, ConfigError for an unknown setting.
    """
    from sensors.optitrack.source import MotiveFile, OptiTrackSource, check_server

    settings = optitrack_settings(options.extra)
    if spec.endswith(".csv"):
        return MotiveFile(Path(spec), settings)
    return OptiTrackSource(check_server(spec.partition(":")[2]), settings, options.seconds)
