"""What may be set about the odometry; the defaults are meant to work everywhere."""

from pydantic import BaseModel, Field


class OdometrySettings(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """Settings of front-end and back-end."""

    max_features: int = Field(400, ge=50, le=2000, description="landmarks looked for in a frame")
    cell_px: int = Field(
        22,
        ge=8,
        le=100,
        description="a key frame adds at most one corner a square of this side, of an image scaled to 480 to 1280 px",
    )
    local_keyframes: int = Field(10, ge=2, le=50, description="key frames whose landmarks are looked for")
    window_keyframes: int = Field(7, ge=2, le=30, description="newest key frames adjusted together")
    background_delay_frames: int = Field(
        4, ge=1, le=30, description="frames that adjustment and place recognition may take in the background"
    )
    map_keyframes: int = Field(
        400,
        ge=10,
        le=100_000,
        description="key frames remembered, some 0.4 MB each; beyond, the oldest elsewhere is forgotten",
    )
    bridge_s: float = Field(0.12, ge=0, le=10, description="a motion prediction may stand in for this long before LOST")
    new_segment_s: float = Field(1.0, ge=0.01, le=3600, description="LOST with sight for so long begins a new segment")
    self_calibration: bool = Field(
        True,
        description="look for a better calibration on the way and at the end, and go on with it where the one "
        "given is clearly poor (in Python: give the Odometry a MidRunCalibrator)",
    )
    pixel_sigma_px: float = Field(0.6, ge=0.01, le=100, description="localisation noise of a feature, at the start")
    inverse_depth_sigma: float = Field(
        2.1e-3,
        ge=1e-6,
        le=10,
        description="noise of the inverse depth, at the start",
        json_schema_extra={"unit": "1/m"},
    )
    readout_prior_s: float = Field(
        0.024,
        ge=-1,
        le=1,
        description="rolling shutter's readout expected before it is known: most of a 30 Hz period; negative where the "
        "lowest row is read first, as in images turned by 180 degrees",
    )
    readout_prior_sigma_s: float = Field(0.007, ge=1e-6, le=1, description="one sigma of it")
    depth_lag_prior_s: float = Field(
        -0.015,
        ge=-1,
        le=1,
        description="lag of the depth stream's stamps expected before it is known: half of a 30 Hz period",
    )
    depth_lag_prior_sigma_s: float = Field(0.008, ge=1e-6, le=1, description="one sigma of it")
    depth_readout_prior_s: float = Field(
        0.012,
        ge=-1,
        le=1,
        description="the depth shutter's readout expected before it is known: between global and rolling",
    )
    depth_readout_prior_sigma_s: float = Field(0.012, ge=1e-6, le=1, description="one sigma of it")
