"""What can be set about the viewer."""

from pydantic import BaseModel, Field

from odom.viewer.keyframe_clouds import KEYFRAMES


class ViewerSettings(BaseModel, frozen=True, extra="forbid", allow_inf_nan=False):
    """Where the viewer is served, how much it may remember and how often images are shown."""

    host: str = Field("127.0.0.1", description="address the web page and its data are served on")
    web_port: int = Field(9090, ge=0, le=65535, description="port of the web page; the next free one if taken")
    data_port: int = Field(9876, ge=0, le=65535, description="port of the data of the page; the next free one if taken")
    server_memory_mib: int = Field(
        192, ge=16, le=1_000_000, description="data kept for browsers that open the page late"
    )
    desktop_memory_mib: int = Field(512, ge=64, le=1_000_000, description="memory of the desktop viewer")
    image_rate_hz: float = Field(30.0, ge=0.01, le=1000, description="images shown a second at the most")
    jpeg_quality: int = Field(80, ge=1, le=100, description="of colour images that arrive uncompressed")
    chain: bool = Field(True, description="the chain of pairwise registrations is drawn as a line of its own")
    path_poses: int = Field(
        4096, ge=64, le=1_000_000, description="poses drawn a trajectory; older ones are thinned beyond"
    )
    cloud_keyframes: int = Field(KEYFRAMES, ge=2, le=100_000, description="key frames drawn as clouds; thinned beyond")
    loops: int = Field(500, ge=10, le=1_000_000, description="loop candidates drawn; the oldest refused ones go first")
