"""Kinect and its relatives through the real OpenNI2 library, live or from an .oni file."""

from pathlib import Path

from odom.errors import ConfigError
from sensors.openni2.settings import KinectSettings
from sensors.source import Source, SourceOptions
from sensors.source_options import read_options


def open_kinect(spec: str, options: SourceOptions) -> Source:
    """Open `kinect` (the first device), `kinect:URI`, `kinect:SERIAL` or `kinect:FILE.oni`.

    `options.extra` holds the settings of `KinectSettings`. Raises DeviceError, with what to do, when the library or
    the device is missing, busy, forbidden or silent; RecordingError for a file that cannot be played; ConfigError for
    settings it does not have.
    """
    name, _, wanted = spec.partition(":")
    if name != "kinect":
        raise ConfigError(f"{spec}: not a Kinect: give kinect, kinect:URI, kinect:SERIAL or kinect:FILE.oni")
    settings = read_options("kinect", KinectSettings, dict(options.extra))
    if wanted.endswith(".oni"):
        from sensors.openni2.playback import OniRecording

        return OniRecording(Path(wanted), options, settings)
    from sensors.openni2.live import LiveKinect

    return LiveKinect(wanted, options, settings)
