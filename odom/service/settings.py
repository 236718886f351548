"""Every setting, nested by part."""

from pathlib import Path

from pydantic import BaseModel, Field

from odom.backend import OdometrySettings
from odom.service.settings_sources import Sourced, load, read_file
from odom.viewer import ViewerSettings
from odom.wire import WireSettings
from odom.wire.optional_file import OptionalFile


class ServiceSettings(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """What the odometry process and `odom run` do beside the odometry itself."""

    status_period_s: float = Field(
        0.2, ge=0.001, le=60, description="between two status messages of an unchanged state"
    )
    features_period_s: float = Field(0.066, ge=0.001, le=60, description="between two feature clouds for the viewer")
    map_period_s: float = Field(0.5, ge=0.001, le=60, description="between two paths with landmarks for the viewer")
    keyframe_points: int = Field(
        3000, ge=100, le=300_000, description="points of the coloured cloud of a key frame for the viewer"
    )
    mask: OptionalFile = Field(
        None, description="image, white where the camera sees what carries it instead of the scene (see odom mask)"
    )
    live_frames: int = Field(
        4, ge=1, le=1000, description="frames of a live source that may wait, after its first second; the newest win"
    )
    stop_timeout_s: float = Field(
        60.0, ge=0.001, le=3600, description="a child may take this long to save its results and end"
    )


class Settings(Sourced):
    """All settings; see `odom config`."""

    odometry: OdometrySettings = OdometrySettings()
    wire: WireSettings = WireSettings()
    service: ServiceSettings = ServiceSettings()
    viewer: ViewerSettings = ViewerSettings()


def load_settings(config: Path | None = None) -> Settings:
    """Return the settings of the environment, the YAML file `config` (or `$ODOM_CONFIG`) and the defaults.

    Raises ConfigError naming each setting that is unknown or out of range.
    """
    return load(Settings, read_file(config))
