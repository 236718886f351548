"""How a Kinect is asked to work."""

from enum import Enum, unique

from pydantic import BaseModel, Field


@unique
class Registration(Enum):
    """Who maps depth to colour: `auto` takes the driver where it can, else the calibration file's extrinsic."""

    AUTO = "auto"
    DRIVER = "driver"
    SOFTWARE = "software"
    OFF = "off"


class KinectSettings(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """Options of `odom sensor kinect`, given as `--option name=value`."""

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
        2.0, gt=0, description="time without a frame of colour or of depth after which the device counts as gone"
    )
    start_s: float = Field(4.0, gt=0, description="time a device has to deliver its first frames of both")

    @property
    def width_height(self) -> tuple[int, int]:
        """The image size in pixels."""
        width, height = self.size.split("x")
        return int(width), int(height)
