"""Settings of the Zenoh session."""

from typing import Literal, Self

from pydantic import BaseModel, Field, JsonValue

from odom.wire.security import SecuritySettings
from odom.wire.text_list import TextList

LOCAL = "tcp/127.0.0.1:7447"
ROS2_ROUTER = "tcp/localhost:7447"
"""Where ROS 2's own processes look for their router (rmw_zenohd)."""
ANY_LOCAL_PORT = "tcp/127.0.0.1:0"

Compression = Literal["zstd", "lz4", "none"]
"""How the chunks of a recording are compressed."""


class WireSettings(BaseModel, frozen=True, extra="forbid"):
    """How this process connects to the others; by default over the loopback interface of this machine only.

    A `peer` finds the others through any one of the `connect` endpoints and then talks to each directly; a `client`
    talks to its router only; a `router` passes messages on between those that it does not itself concern.
    """

    mode: Literal["peer", "client", "router"] = Field("peer", description="role of this process in the Zenoh network")
    connect: TextList = Field((LOCAL,), description="Zenoh endpoints to connect to, tried until they answer")
    listen: TextList = Field(
        (LOCAL, ANY_LOCAL_PORT),
        description="Zenoh endpoints to listen on; a default or a meeting point may be taken, any other must be free",
    )
    namespace: str = Field("cam0", description="name of the device, first part of its keys")
    lease_ms: int = Field(2000, ge=200, le=3_600_000, description="a process silent for so long counts as gone")
    drop_after_ms: int = Field(
        40, ge=0, le=60_000, description="a live message waits so long for a congested link before it is dropped"
    )
    ros2_domain: int | None = Field(
        None, ge=0, le=232, description="ROS 2 domain in which sensor and odometry are seen, none: not seen (--ros2)"
    )
    ros2_router: str = Field(ROS2_ROUTER, description="Zenoh endpoint of the router of ROS 2 (rmw_zenohd)")
    ros2_type_hashes: bool = Field(True, description="write hashes of types into ROS 2 keys; off for ROS 2 Humble")
    security: SecuritySettings = Field(SecuritySettings(), description="certificates, identities and rules")
    zenoh: dict[str, JsonValue] = Field(
        default_factory=dict,
        description="further Zenoh configuration: path such as transport/auth/usrpwd/user to value",
    )

    def as_guest(self) -> Self:
        """Return the settings of a process that connects to the others but listens only where it was told to.

        The process that starts first listens at the meeting point. While it is frozen the system still accepts
        connections for it, so that all later processes wait there and never meet: so no process that only watches, such
        as a viewer, may listen there.
        """
        return self.model_copy(update={"listen": tuple(where for where in self.listen if self.on_purpose(where))})

    def left_to_ros2(self, where: str) -> bool:
        """Whether an endpoint to listen on is that of ROS 2's router, which could not start if it were taken."""
        here = (ROS2_ROUTER, LOCAL)
        return self.ros2_domain is not None and self.ros2_router in here and where in here

    def on_purpose(self, where: str) -> bool:
        """Whether an endpoint to listen on was asked for: it is neither a default nor one to connect to."""
        return where not in (*self.connect, LOCAL, ANY_LOCAL_PORT)
