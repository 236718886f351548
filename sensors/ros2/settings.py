"""How topics of ROS 2 are found and read."""

import os
from typing import Literal

from pydantic import BaseModel, Field

from odom.wire.settings import ROS2_ROUTER

DOMAIN_ENVIRONMENT = "ROS_DOMAIN_ID"


def _domain() -> int:
    text = os.environ.get(DOMAIN_ENVIRONMENT, "")
    return int(text) if text.isdecimal() else 0


class Ros2Settings(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """Options of `odom sensor ros2:/camera`, given as `--option name=value`."""

    domain: int = Field(default_factory=_domain, ge=0, le=232, description="ROS domain; by default $ROS_DOMAIN_ID or 0")
    router: str = Field(
        default_factory=lambda: os.environ.get("ODOM_WIRE__ROS2_ROUTER", ROS2_ROUTER),
        pattern=r"^[a-z]+/.+$",
        description="Zenoh endpoint of the router of ROS 2",
    )
    transport: Literal["raw", "compressed"] = Field("raw", description="which of an image's topics is taken of both")
    start_s: float = Field(5.0, gt=0, le=3600, description="time for images and calibration to come")
    silence_s: float = Field(5.0, gt=0, le=3600, description="time without an image after which it is told")
    end_s: float = Field(0.0, ge=0, le=3600, description="end after so long without an image; 0: wait for ever")
    waiting: int = Field(4, ge=1, le=100, description="images of a topic that may wait; the newest win")
