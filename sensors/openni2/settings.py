"""How a Kinect is asked to work."""

from enum import Enum, unique

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from odom.errors import ConfigError


@unique
class Registration(Enum):
    """Who maps depth to colour: `auto` takes the driver where it can, else the calibration file's extrinsic."""

    AUTO = "auto"
    DRIVER = "driver"
    SOFTWARE = "software"
    OFF = "off"


class KinectSettings(BaseModel):
    """Options of `odom sensor kinect`, given as `--option name=value`."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    size: str = Field(
        "640x480", pattern=r"^\d+x\d+$", description="image size of colour and depth", json_schema_extra={"unit": "px"}
    )
    fps: int = Field(30, gt=0, description="frames a second", json_schema_extra={"unit": "Hz"})
    registration: Registration = Field(
        Registration.AUTO, description="who maps depth to colour: auto, driver, software, off"
    )
    sync: bool = Field(True, description="ask the device to expose colour and depth together, where it can")
    auto_exposure: bool = Field(
        True, description="automatic exposure and white balance; off keeps both as they are at the start"
    )
    silence_s: float = Field(
        2.0, gt=0, description="without a frame of colour or of depth for so long the device is taken to be gone"
    )
    start_s: float = Field(4.0, gt=0, description="time a device has to deliver its first frames of both")

    @property
    def width_height(self) -> tuple[int, int]:
        """The image size in pixels."""
        width, height = self.size.split("x")
        return int(width), int(height)


def kinect_settings(extra: tuple[tuple[str, str], ...]) -> KinectSettings:
    """Return the settings in `extra`; raises ConfigError, naming the option, for one that is unknown or malformed."""
    try:
        return KinectSettings.model_validate(dict(extra))
    except ValidationError as error:
        first = error.errors()[0]
        name = ".".join(str(part) for part in first["loc"])
        known = ", ".join(KinectSettings.model_fields)
        raise ConfigError(f"kinect option {name}: {first['msg']} (options: {known})") from error
