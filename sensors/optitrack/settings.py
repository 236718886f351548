"""How an OptiTrack server is reached."""

from pydantic import BaseModel, Field

NATNET_VERSION = (4, 1)
"""Protocol asked of a unicast server (Motive 3.1); a multicast server streams what Motive was set to."""


class OptiTrackSettings(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """Options of `odom sensor optitrack:SERVER`, given as `--option name=value`."""

    local: str = Field(
        "", description="address of this machine's interface to the server, for multicast; empty: the system's choice"
    )
    command_port: int = Field(1510, ge=1, le=65535, description="the server's command port")
    body: str = Field("", description="publish this rigid body only; empty: all")
    y_up: bool = Field(True, description="Motive streams with y up (its default): turn to z up")
    start_s: float = Field(0.0, ge=0, description="a CSV file: when its capture began, seconds of Unix time")
    timeout_s: float = Field(5.0, gt=0, description="time for the server to answer at the start")
