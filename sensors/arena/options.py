"""What can be chosen about the simulated laboratory."""

from dataclasses import replace
from typing import Annotated, Literal, Self

from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass

from odom.frame import Camera, Stamp
from sensors.arena.ring import ROWS, round_m
from sensors.source_options import read_options

KEY_POSES = 120
"""Poses of a lap of the infinity of which results are reported; more make the lap longer and slower to walk."""
FRAMES_PER_KEY_POSE = 8
"""Frames from one key pose to the next, of which a lap of 32 s has 960."""
RATE_HZ = 30.0
"""Frames a second of both Kinects."""
KINECT1 = Camera(640, 480, 525.0, 525.0, 319.5, 239.5)
"""The colour camera of a Kinect v1 as drivers assume it without calibration, pixels."""
KINECT2 = Camera(640, 360, 353.4, 353.4, 319.5, 179.5)
"""That of a Kinect v2, 1920 x 1080, at a third of its size."""
BARREL = (0.12, -0.22, 0.0008, -0.0006, 0.0)
"""A lens such as a Kinect's colour camera has (plumb_bob)."""
START = Stamp(1_700_000_000_000_000_000)
"""First stamp of a session that is not live: a day in 2023."""

WALKING_M_S = 0.6
"""How fast the camera is carried round a building, metres a second."""
PAST_M = 12.0
"""How far a round goes on past where it began, metres: so that what is there is seen again."""

Count = Annotated[int, Field(ge=1)]
Ratio = Annotated[float, Field(ge=0.8, le=1.25)]
Shift = Annotated[float, Field(ge=-50, le=50)]


@dataclass(frozen=True, config=ConfigDict(extra="forbid", allow_inf_nan=False))
class ArenaOptions:
    """Everything about a session; equal options give equal bytes. Raises pydantic's ValidationError, a ValueError.

    `walk`: `infinity` (a closed lying eight, 960 frames a lap), `rest` (a tripod), `corridor` (past identical
    rooms), `joined` (a lap in one room, then in another one, without a way between). `laps` repeats the infinity;
    `rooms` (a multiple of 4; 0: none) makes a building of so many instead, of different kinds and of look-alike ones,
    and a walk round it: 92 of them are 300 m. `seconds` sets the length instead (0: the walk's own). `every` keeps each
    n-th frame only (8: the key poses) and `half` halves the images' sides, as the sensor's small mode does.
    `jpeg_quality` is that of colour sent as JPEG.
    `faults=False` gives perfect images. `blackout` names what is missing (`frames`, `color`, `depth`) from
    `blackout_start_s` for `blackout_s`. `distortion` bends the colour lens. `mocap_offset_s` is the motion capture's
    clock minus the camera's; `marker_m` and `marker_deg` are how far the marker `body` is from the camera.
    `visit` counts the sessions in the rooms of one seed: each has noise and steps of its own, begins elsewhere on the
    lap, and after the first one four things in the laboratory have moved and its lamps are dimmer.
    `people` (0 to 4) walk about, sit down, carry a carton: in the laboratory, not in the corridor.
    `exact_truth` adds the camera's own exact pose. `start` is the first stamp (nanoseconds).

    `focal_x`, `focal_y` (ratios) and `centre_x_px`, `centre_y_px` are how far the camera is from the average one;
    `told` says which calibration is sent, the `exact` one or the `average` one (without distortion). `beside` leaves
    the offset from infrared to colour camera out of the registration of depth, as a driver with a wrong table does;
    `depth_scale` is the depth shown for a true metre.
    """

    seed: Annotated[int, Field(ge=0)] = 1
    rooms: Annotated[int, Field(ge=0, le=400, multiple_of=ROWS)] = 0
    visit: Annotated[int, Field(ge=0, le=1000)] = 0
    sensor: Literal["kinect1", "kinect2"] = "kinect1"
    walk: Literal["infinity", "rest", "corridor", "joined"] = "infinity"
    laps: Count = 1
    seconds: Annotated[float, Field(ge=0, le=1e8)] = 0.0
    every: Count = 1
    half: bool = False
    people: Annotated[int, Field(ge=0, le=4)] = 0
    jpeg_quality: Annotated[int, Field(ge=1, le=100)] = 90
    faults: bool = True
    distortion: bool = False
    focal_x: Ratio = 1.0
    focal_y: Ratio = 1.0
    centre_x_px: Shift = 0.0
    centre_y_px: Shift = 0.0
    told: Literal["exact", "average"] = "exact"
    beside: bool = False
    depth_scale: Ratio = 1.0
    blackout: Literal["", "frames", "color", "depth"] = ""
    blackout_start_s: Annotated[float, Field(ge=0, le=1e8)] = 15.0
    blackout_s: Annotated[float, Field(ge=0, le=1e8)] = 1.0
    mocap: bool = True
    mocap_offset_s: Annotated[float, Field(ge=-3600, le=3600)] = 0.037
    marker_m: Annotated[float, Field(ge=-10, le=10)] = 0.08
    marker_deg: Annotated[float, Field(ge=-360, le=360)] = 30.0
    exact_truth: bool = False
    body: str = "kinect"
    start: Annotated[Stamp, Field(ge=0, le=9 * 10**18)] = START

    def __post_init__(self) -> None:
        if self.people and self.walk == "corridor":
            raise ValueError("people are in the laboratory only: choose another walk than corridor, or people=0")

        if self.rooms and (self.people or self.walk != "infinity"):
            raise ValueError("a building has its own walk, without people: leave out rooms, or people and walk")

    @classmethod
    def from_texts(cls, texts: dict[str, str]) -> Self:
        """Return options from texts, as a command line gives them. Raises ConfigError for what does not fit."""
        return read_options("arena", cls, texts)

    @property
    def own_seed(self) -> int:
        """The seed of what two visits to the same rooms do not share."""
        return self.seed if not self.visit else self.seed + 1_000_003 * self.visit

    @property
    def camera(self) -> Camera:
        """The colour camera, to which depth is registered."""
        c = KINECT1 if self.sensor == "kinect1" else KINECT2
        c = replace(
            c,
            fx=c.fx * self.focal_x,
            fy=c.fy * self.focal_y,
            cx=c.cx + self.centre_x_px,
            cy=c.cy + self.centre_y_px,
            distortion=BARREL if self.distortion else (),
        )
        return halved(c, 0.5) if self.half else c

    @property
    def told_camera(self) -> Camera:
        """The calibration that is sent."""
        average = replace(self, focal_x=1.0, focal_y=1.0, centre_x_px=0.0, centre_y_px=0.0, distortion=False)
        return average.camera if self.told == "average" else self.camera

    @property
    def frames(self) -> int:
        """How many frames the session has at 30 Hz, kept or not."""
        if self.seconds:
            return max(1, round(self.seconds * RATE_HZ))
        if self.rooms:
            return round((self.laps * round_m(self.rooms) + PAST_M) / WALKING_M_S * RATE_HZ)
        lap = KEY_POSES * FRAMES_PER_KEY_POSE
        whole = {"infinity": lap * self.laps + 1, "rest": 1800, "corridor": 1800, "joined": 2 * (lap + 1)}
        return whole[self.walk]


def halved(camera: Camera, shift: float) -> Camera:
    """Return the camera of images half the size: 2 x 2 pixels averaged (`shift` .5) or every other one taken (0)."""
    cx, cy = (camera.cx - shift) / 2, (camera.cy - shift) / 2
    return Camera(camera.width // 2, camera.height // 2, camera.fx / 2, camera.fy / 2, cx, cy, camera.distortion)
