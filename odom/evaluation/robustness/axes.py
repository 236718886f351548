"""The named axes along which a recording is spoilt, each with its levels from mild to hard."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from odom.evaluation.painter import Painter, anchor_at_rest, anchor_in_world
from odom.evaluation.passers_by import passers_by
from odom.evaluation.robustness import color, depth, timing
from odom.evaluation.robustness.spoiler import Scene, Spoiler
from odom.frame import Camera, RgbdFrame
from odom.frontend.camera.lens import Lens

_SLIM, _WIDE = 0.15, 0.33
"""The share of the width that one body has where something else is spoilt, too: alone, it costs hardly anything."""


@dataclass(frozen=True)
class Level:
    """One level of an axis: what it is called in the table, and the numbers that its spoiler takes."""

    label: str
    values: tuple[float, ...]


@dataclass(frozen=True)
class Axis:
    """A way to spoil a recording. `title` says what the levels' labels measure; `spoil` takes a scene and values."""

    name: str
    title: str
    levels: tuple[Level, ...]
    spoil: Callable[..., Spoiler]

    def spoiler(self, level: int, scene: Scene) -> Spoiler:
        """Return what the `level`-th level (from 0) does to a recording of `scene`."""
        return self.spoil(scene, *self.levels[level].values)


def _numbers(*values: float, scale: float = 1.0) -> tuple[Level, ...]:
    """Return levels called by their numbers, whose spoilers take them `scale` times as large."""
    return tuple(Level(f"{value:g}".removeprefix("0") or "0", (scale * value,)) for value in values)


def _blur(scene: Scene, length_px: float) -> Spoiler:
    return Spoiler(frame=lambda frame: color.motion_blur(frame, length_px, scene.seed))


def _darkness(scene: Scene, light: float) -> Spoiler:
    return Spoiler(frame=lambda frame: color.darkness(frame, light, scene.seed))


def _exposure(scene: Scene, stops: float) -> Spoiler:
    return Spoiler(frame=lambda frame: color.exposure_swing(frame, stops, scene.begin))


def _jpeg(scene: Scene, quality: float) -> Spoiler:
    return Spoiler(frame=lambda frame: color.jpeg(frame, int(quality)))


def _torn(scene: Scene, share: float) -> Spoiler:
    return Spoiler(frame=lambda frame: color.torn_rows(frame, share, scene.seed))


def _black_outs(scene: Scene, seconds: float) -> Spoiler:
    return Spoiler(
        frame=lambda frame: color.black_out(frame, seconds, scene.begin, scene.seed),
        light_returns=lambda stamp: color.light_returns(stamp, seconds, scene.begin),
    )


def _dropped(scene: Scene, n: float) -> Spoiler:
    return Spoiler(frame=lambda frame: timing.one_in(frame, int(n)))


def _jitter(scene: Scene, sigma_s: float) -> Spoiler:
    return Spoiler(stamp=lambda stream, stamp: timing.jitter(stream, stamp, sigma_s, scene.seed))


def _lag(scene: Scene, lag_s: float) -> Spoiler:
    return Spoiler(stamp=lambda stream, stamp: timing.late_depth(stream, stamp, lag_s))


def _holes(scene: Scene, share: float) -> Spoiler:
    return Spoiler(frame=lambda frame: depth.holes(frame, share, scene.seed))


def _range(scene: Scene, times: float) -> Spoiler:
    return Spoiler(frame=lambda frame: depth.out_of_range(frame, times * scene.near_m))


def _depth_noise(scene: Scene, factor: float) -> Spoiler:
    return Spoiler(frame=lambda frame: depth.noise(frame, factor, scene.seed))


def _focal(scene: Scene, percent: float) -> Spoiler:
    return Spoiler(camera=lambda camera: longer(camera, percent))


def longer(camera: Camera, percent: float) -> Camera:
    """Return the calibration with focal lengths `percent` too long."""
    factor = 1.0 + 0.01 * percent
    return replace(camera, fx=factor * camera.fx, fy=factor * camera.fy)


def _painter(scene: Scene, share: float, count: int) -> Painter:
    bodies = passers_by(scene.camera, scene.near_m, count=count, share=share, seed=scene.seed)
    anchor, lens = anchor_in_world(scene.path), Lens.of(scene.camera)
    return Painter(scene.camera, bodies, scene.begin, anchor, lens, scene.seed)


def _passers_by(scene: Scene, share: float, count: float) -> Spoiler:
    painter = _painter(scene, share, int(count))
    return Spoiler(frame=lambda frame: painter.paint(frame)[0])


def _people_who_rest(scene: Scene, share: float, count: float) -> Spoiler:
    bodies = passers_by(scene.camera, scene.near_m, count=int(count), share=share, seed=scene.seed, rest=True)
    anchor, lens = anchor_at_rest(scene.estimated), Lens.of(scene.camera)
    painter = Painter(scene.camera, bodies, scene.begin, anchor, lens, scene.seed, scene.timing)
    return Spoiler(frame=lambda frame: painter.paint(frame)[0])


def _blurred_people(scene: Scene, length_px: float) -> Spoiler:
    painter = _painter(scene, _SLIM, 1)
    return Spoiler(frame=lambda frame: color.motion_blur(painter.paint(frame)[0], length_px, scene.seed))


def _people_thinned(scene: Scene, n: float) -> Spoiler:
    painter = _painter(scene, _WIDE, 1)

    def frame(frame: RgbdFrame) -> RgbdFrame | None:
        left = timing.one_in(frame, int(n))
        return None if left is None else painter.paint(left)[0]

    return Spoiler(frame=frame)


def _people_near(scene: Scene, times: float) -> Spoiler:
    painter = _painter(scene, _SLIM, 1)
    return Spoiler(frame=lambda frame: depth.out_of_range(painter.paint(frame)[0], times * scene.near_m))


_BODIES = (
    Level(".15", (0.15, 1)), Level(".33", (0.33, 1)), Level(".5", (0.5, 1)), Level("three of .33", (0.33, 3)),
)  # fmt: skip

_LEFT = tuple(Level(f"1/{n}", (n,)) for n in (2, 4, 8, 16))

AXES = (
    Axis("blur", "motion blur, px", _numbers(5, 10, 20, 40), _blur),
    Axis("darkness", "share of the light, with noise", _numbers(0.5, 0.25, 0.12, 0.06, 0.03), _darkness),
    Axis("exposure", "exposure swings, stops", _numbers(0.5, 1, 2, 3), _exposure),
    Axis("jpeg", "JPEG quality", _numbers(50, 20, 10, 5), _jpeg),
    Axis("torn", "share of rows torn", _numbers(0.1, 0.25, 0.5, 0.75), _torn),
    Axis("black-outs", "black-outs every 8 s, s", _numbers(0.2, 0.5, 1, 2, 4), _black_outs),
    Axis("passers-by", "passers-by, share of the width", _BODIES, _passers_by),
    Axis("people-who-rest", "people who rest and walk, share of the width", _BODIES, _people_who_rest),
    Axis("blurred-people", "blur with a passer-by, px", _numbers(5, 10, 20), _blurred_people),
    Axis("people-near", "range with a passer-by, times near", _numbers(2, 1.5, 1.2), _people_near),
    Axis("people-thinned", "frames that are left, with a passer-by", _LEFT, _people_thinned),
    Axis("dropped", "frames that are left", _LEFT, _dropped),
    Axis("jitter", "stamp jitter, ms", _numbers(2, 5, 10, 20, scale=1e-3), _jitter),
    Axis("lag", "depth older than its stamp, ms", _numbers(10, 20, 40, 80, scale=1e-3), _lag),
    Axis("holes", "share of the depth missing", _numbers(0.25, 0.5, 0.75, 0.9), _holes),
    Axis("range", "range of depth, times what is near", _numbers(2, 1.5, 1.2, 1.1), _range),
    Axis("depth-noise", "depth noise, times a Kinect's", _numbers(2, 4, 8, 16), _depth_noise),
    Axis("focal", "focal length too long, %", _numbers(1, 2, 5, 10), _focal),
)
"""All axes: what spoils colour, what moves, what spoils time, depth and calibration."""
