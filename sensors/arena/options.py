"""What can be chosen about the simulated laboratory."""

from dataclasses import dataclass, fields, replace
from typing import Literal, Self, get_args, get_type_hints

from odom.errors import ConfigError
from odom.frame import Camera, Stamp

Sensor = Literal["kinect1", "kinect2"]
WalkName = Literal["infinity", "rest", "corridor", "joined"]
Blackout = Literal["", "frames", "color", "depth"]

KEY_POSES = 120
FRAMES_PER_KEY_POSE = 8
RATE_HZ = 30.0
KINECT1 = Camera(640, 480, 525.0, 525.0, 319.5, 239.5)
KINECT2 = Camera(640, 360, 353.4, 353.4, 319.5, 179.5)
BARREL = (0.12, -0.22, 0.0008, -0.0006, 0.0)
"""A lens such as a Kinect's colour camera has (plumb_bob)."""
START = Stamp(1_700_000_000_000_000_000)


@dataclass(frozen=True)
class ArenaOptions:
    """Everything about a session; equal options give equal bytes.

    `walk`: `infinity` (a closed lying eight, 960 frames a lap), `rest` (a tripod), `corridor` (past identical
    rooms), `joined` (a lap in one room, then in another one, without a way between). `laps` repeats the infinity;
    `seconds` sets the length instead (0: the walk's own). `every` keeps each n-th frame only (8: the key poses) and
    `half` halves the images' sides, as the sensor's small mode does. `jpeg_quality` is that of colour sent as JPEG.
    `faults=False` gives perfect images. `blackout` names what is missing (`frames`, `color`, `depth`) from
    `blackout_start_s` for `blackout_s`. `distortion` bends the colour lens. `mocap_offset_s` is the motion capture's
    clock minus the camera's; `marker_m` and `marker_deg` are how far the marker `body` is from the camera.
    `exact_truth` adds the camera's own exact pose. `start` is the first stamp (nanoseconds).
    """

    seed: int = 1
    sensor: Sensor = "kinect1"
    walk: WalkName = "infinity"
    laps: int = 1
    seconds: float = 0.0
    every: int = 1
    half: bool = False
    jpeg_quality: int = 90
    faults: bool = True
    distortion: bool = False
    blackout: Blackout = ""
    blackout_start_s: float = 15.0
    blackout_s: float = 1.0
    mocap: bool = True
    mocap_offset_s: float = 0.037
    marker_m: float = 0.08
    marker_deg: float = 30.0
    exact_truth: bool = False
    body: str = "kinect"
    start: Stamp = START

    def __post_init__(self) -> None:
        for name, hint in (("sensor", Sensor), ("walk", WalkName), ("blackout", Blackout)):
            if getattr(self, name) not in get_args(hint):
                raise ConfigError(
                    f"arena: {name}={getattr(self, name)!r}: give one of {', '.join(map(repr, get_args(hint)))}"
                )
        if not 1 <= self.jpeg_quality <= 100:
            raise ConfigError(f"arena: jpeg_quality={self.jpeg_quality}: give 1 to 100")
        if min(self.laps, self.every) < 1 or min(self.seconds, self.seed) < 0:
            raise ConfigError("arena: laps and every must be at least 1, seconds and seed not negative")

    @classmethod
    def from_texts(cls, texts: dict[str, str]) -> Self:
        """Return options from texts, as a command line gives them. Raises ConfigError for what does not fit."""
        hints = get_type_hints(cls)
        known = {f.name for f in fields(cls)}
        values: dict[str, object] = {}
        for name, text in texts.items():
            if name not in known:
                raise ConfigError(f"arena: there is no option {name!r}; there are {', '.join(sorted(known))}")
            try:
                values[name] = _parse(text, hints[name])
            except ValueError as error:
                raise ConfigError(f"arena: {name}={text!r}: {error}") from error
        return cls(**values)  # type: ignore[arg-type]  # each value was made by its field's own type

    @property
    def camera(self) -> Camera:
        """The colour camera, to which depth is registered."""
        c = KINECT1 if self.sensor == "kinect1" else KINECT2
        c = replace(c, distortion=BARREL if self.distortion else ())
        return halved(c, 0.5) if self.half else c

    @property
    def frames(self) -> int:
        """How many frames the session has at 30 Hz, kept or not."""
        if self.seconds:
            return max(1, round(self.seconds * RATE_HZ))
        lap = KEY_POSES * FRAMES_PER_KEY_POSE
        whole = {"infinity": lap * self.laps + 1, "rest": 1800, "corridor": 1800, "joined": 2 * (lap + 1)}
        return whole[self.walk]


def halved(camera: Camera, shift: float) -> Camera:
    """Return the camera of images half the size: 2 x 2 pixels averaged (`shift` .5) or every other one taken (0)."""
    return replace(
        camera,
        width=camera.width // 2,
        height=camera.height // 2,
        fx=camera.fx / 2,
        fy=camera.fy / 2,
        cx=(camera.cx - shift) / 2,
        cy=(camera.cy - shift) / 2,
    )


def _parse(text: str, hint: object) -> object:
    if hint is bool:
        if text.lower() not in ("1", "0", "true", "false", "yes", "no"):
            raise ValueError("give true or false")
        return text.lower() in ("1", "true", "yes")
    if hint is int or hint is Stamp:
        return int(text)
    if hint is float:
        return float(text)
    return text
