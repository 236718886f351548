"""The parameters of a camera: their order, units and priors, and what motion shows them."""

from dataclasses import dataclass, replace

import numpy as np

from odom.calibration.tuning import TUNING
from odom.errors import ConfigError
from odom.frame import Camera, DepthModel
from odom.geometry.arrays import Array, Index


@dataclass(frozen=True)
class Group:
    """Parameters that are shown together or not at all: `names` with a `unit`, and the motion that shows them."""

    key: str
    names: tuple[str, ...]
    unit: str
    shown_by: str


GROUPS = (
    Group("timing", ("readout_s", "depth_lag_s", "depth_readout_s"), "s", "turn the camera quickly, to and fro"),
    Group("focal length", ("fx", "fy"), "px", "turn the camera to all sides, about its own axis too"),
    Group("image centre", ("cx", "cy"), "px", "turn the camera about its axis, held upright and on its side"),
    Group(
        "lens distortion",
        ("k1", "k2", "p1", "p2", "k3"),
        "1",
        "let things with texture pass through the corners of the image",
    ),
    Group("depth shift", ("shift_u_px", "shift_v_px"), "px", "look along floors, tables and walls from several sides"),
    Group("depth baseline", ("baseline_u", "baseline_v"), "px m", "look along slanted surfaces from near and from far"),
    Group(
        "depth offset",
        tuple(f"offset_{term}" for term in ("1", "x", "y", "xx", "xy", "yy")),
        "1/m",
        "see the same things from near and from far, in the middle and at the border of the image",
    ),
    Group("depth scale", ("scale_1",), "1", "record motion capture of the camera too, on a way of several metres"),
    Group(
        "depth field",
        tuple(f"scale_{term}" for term in ("x", "y", "xx", "xy", "yy")),
        "1",
        "see the same things from near and from far, in the middle and at the border of the image",
    ),
    Group(
        "depth stretch",
        ("stretch_u", "stretch_v"),
        "1",
        "look along slanted surfaces that pass through the image from border to border",
    ),
)
NAMES = tuple(name for group in GROUPS for name in group.names)
"""All parameters, in the order of a parameter vector."""
TIMINGS = 3
"""The vector begins with the timing, then come the lens (9) and the depth model (18)."""
LENS = slice(TIMINGS, TIMINGS + 9)
DEPTH = slice(TIMINGS + 9, TIMINGS + 27)
SHIFT, BASELINE = slice(DEPTH.start, DEPTH.start + 2), slice(DEPTH.start + 2, DEPTH.start + 4)
OFFSET, SCALE = slice(DEPTH.start + 4, DEPTH.start + 10), slice(DEPTH.start + 10, DEPTH.start + 16)
STRETCH = slice(DEPTH.start + 16, DEPTH.start + 18)
SCALE_NUMBER = NAMES.index("scale_1")
_PLUMB_BOB = 5
"""Terms of ROS's plumb_bob model: k1, k2, p1, p2, k3."""


def indices_of(group: Group) -> Index:
    """Return where a group's parameters are in the vector."""
    return np.array([NAMES.index(name) for name in group.names])


def shown_by(name: str) -> str:
    """Return what motion shows a parameter."""
    return next(group.shown_by for group in GROUPS if name in group.names)


def vector_of(camera: Camera) -> Array:
    """Return the vector (30) of a camera, with no change of the timing.

    Raises ConfigError for a lens of another model than plumb_bob.
    """
    if any(camera.distortion[_PLUMB_BOB:]):
        raise ConfigError("only plumb_bob lenses (k1, k2, p1, p2, k3) can be calibrated: start from one, or from none")
    lens = np.zeros(_PLUMB_BOB)
    known = camera.distortion[:_PLUMB_BOB]
    lens[: len(known)] = known
    intrinsics = [camera.fx, camera.fy, camera.cx, camera.cy]
    return np.concatenate([np.zeros(TIMINGS), intrinsics, lens, camera.depth.vector])


def camera_of(vector: Array, camera: Camera) -> Camera:
    """Return the camera with such a vector, of the image size of `camera`; raises ConfigError for an impossible one."""
    fx, fy, cx, cy, *lens = vector[LENS].tolist()
    distortion = tuple(lens) if any(lens) else ()
    depth = DepthModel.of(vector[DEPTH])
    return replace(camera, fx=fx, fy=fy, cx=cx, cy=cy, distortion=distortion, depth=depth)


def prior_sigma(camera: Camera) -> Array:
    """Return the standard deviations (30) of the parameters of a calibration that a user gives."""
    t = TUNING
    focal, centre = [t.prior_focal * camera.fx, t.prior_focal * camera.fy], [t.prior_centre * camera.width] * 2
    timing = [t.prior_timing_s] * TIMINGS
    lens = [t.prior_k1, t.prior_k2, t.prior_tangential, t.prior_tangential, t.prior_k3]
    moved = [t.prior_shift_px] * 2 + [t.prior_baseline_m * camera.fx] * 2
    fields = [t.prior_offset] * 6 + [t.prior_unit] + [t.prior_field] * 5
    return np.array([*timing, *focal, *centre, *lens, *moved, *fields, *[t.prior_focal] * 2])
