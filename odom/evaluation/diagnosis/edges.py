"""Whether depth and colour show the same thing at the same pixel and at the same time.

Where a near surface ends in the depth image, the colour image has an edge too. The shift between the two is the one
that puts the most colour gradient across the depth edges of many frames. A wrong registration shifts them by the same
pixels whatever the camera does; a wrong depth stamp shifts each by its image velocity times the lag. That velocity
follows from the edge's depth and the camera's motion, so shift and lag are searched together.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from odom.evaluation.diagnosis.motion import PairMotion
from odom.frame import Camera, RgbdFrame
from odom.frontend.features.images import grey_of
from odom.geometry import se3
from odom.geometry.arrays import Array, Image
from odom.geometry.normal_distribution import NORMAL_MAD

_GAP_PX = 8
"""Widest strip without depth beside a near surface, a structured-light sensor's shadow, that is passed over."""
_STEP_SHARE, _STEP_M = 0.08, 0.04
"""A rim is where depth grows by this share and this length: smaller steps are noise, larger ones are rare."""
_INSIDE_PX = 3
"""A near surface is at least so wide: less takes single pixels for surfaces."""
_EDGES_A_FRAME, _LEAST_EDGES = 300, 1000
"""Edges taken of a frame, to save time; and edges of all frames below which nothing is said."""
_COARSE_EDGES = 2500
"""Edges on which the coarse search is done, to save time: fewer leave the peak to chance."""
_REACH_PX, _REACH_S = 24.0, 0.12
"""Shifts and lags that are searched: unregistered depth is off by some 10 to 20 px, unpaired depth by 33 to 100 ms."""
_COARSE_PX, _COARSE_S = 4.0, 0.015
"""Steps of the coarse search, about the width of a peak: wider ones miss it, finer ones cost time."""
_FINE = ((1.5, 0.005), (0.5, 0.002))
"""Steps (px, s) of the two finer searches, seven along each axis about the best so far."""
_LEAST_FLOW_PX = 2.0
"""Spread of the edges' movement in a frame below which no lag is searched: it could not be told from a shift."""
_FRAME_S = 0.03
"""About the time between two frames."""
_BLUR_PX, _USUAL_PX, _FLOOR, _MOST_GRADIENT = 1.5, 61, 0.3, 4.0
"""Of gradient strengths: the blur before, the window of their usual value and its floor as a share of the image's
mean (for dull places), and the multiple of the usual value at which they are clipped."""


@dataclass(frozen=True, eq=False)
class DepthEdges:
    """Pixels (n x 2) at the rim of near surfaces, the unit outward normal as axis (0: x, 1: y), and depth (n, m)."""

    uv: Array
    axis: NDArray[np.intp]
    depth_m: Array


@dataclass(frozen=True)
class EdgeShift:
    """Where colour edges lie relative to depth edges: pixels right and down, and the lag of depth in seconds.

    `lag_s` is how much earlier than stamped the depth was really taken; NaN when the camera moved too little to tell.
    `contrast` is the height of the best match over the spread of all others, in standard deviations.
    """

    shift_px: tuple[float, float]
    lag_s: float
    contrast: float
    edges: int


def depth_edges(depth_mm: NDArray[np.uint16], limit: int, rng: np.random.Generator) -> DepthEdges:
    """Return at most `limit` pixels at which the surface ends and a farther one follows within eight pixels.

    Pixels without depth in between (a structured-light sensor's shadow) are passed over, so the rim is that of the
    near surface on both sides.
    """
    depth = depth_mm.astype(np.float32) * np.float32(1e-3)
    uv, axes, near = [], [], []
    for axis, back in ((0, False), (0, True), (1, False), (1, True)):
        # turned such that the search goes down the rows; `following` is the next pixel that has depth
        view = depth if axis == 1 else np.ascontiguousarray(depth.T)
        view = view[::-1] if back else view
        following = np.zeros_like(view)
        for step in range(_GAP_PX, 0, -1):
            np.copyto(following[:-step], view[step:], where=view[step:] > 0)
        inside = np.zeros_like(view, dtype=bool)
        inside[_INSIDE_PX:] = view[:-_INSIDE_PX] > 0
        rim = inside & (view > 0) & (following > view * (1 + _STEP_SHARE) + _STEP_M)
        rim = rim[::-1] if back else rim
        row, column = np.nonzero(rim if axis == 1 else rim.T)
        uv.append(np.column_stack([column, row]) + (-0.5 if back else 0.5) * np.eye(2)[axis])
        axes.append(np.full(len(row), axis))
        near.append(depth[row, column])
    chosen = rng.permutation(sum(len(axis) for axis in axes))[:limit]
    return DepthEdges(np.vstack(uv)[chosen], np.concatenate(axes)[chosen], np.concatenate(near)[chosen].astype(float))


def edge_shift(frames: Sequence[RgbdFrame], motions: Sequence[PairMotion | None], camera: Camera) -> EdgeShift | None:
    """Return the shift and lag of the depth edges in `frames`; `motions[k]` is the motion about frame k.

    A motion spans two frames of the same sequence, `earlier` and `later` being indices into it. None when the scene
    has too few edges.
    """
    rng = np.random.default_rng(0)
    strengths: list[Image] = []
    positions, velocities, axes, which = [], [], [], []
    for frame, motion in zip(frames, motions, strict=True):
        edges = depth_edges(frame.depth_mm, _EDGES_A_FRAME, rng)
        if motion is None or not len(edges.uv):
            continue
        velocity = _velocity(edges, motion, camera)
        apart = (frame.stamp - frame.depth_stamp) * 1e-9  # the edges are moved to colour's time by the stamps
        which.append(np.full(len(edges.uv), len(strengths)))
        strengths.append(_gradients(grey_of(frame.color)))
        positions.append(edges.uv + apart * velocity)
        velocities.append(velocity)
        axes.append(edges.axis)
    if not which or sum(len(w) for w in which) < _LEAST_EDGES:
        return None
    image, axis = np.concatenate(which), np.concatenate(axes)
    uv, velocity = np.vstack(positions), np.vstack(velocities)
    stack = np.stack(strengths)
    base = (image * 2 + axis) * (stack.shape[2] * stack.shape[3])
    few = rng.permutation(len(uv))[:_COARSE_EDGES]

    # mean colour gradient across the depth edges, for each of several shifts and lags of all of them
    def scores(xs: Array, ys: Array, lags: Array, chosen: NDArray[np.intp] | slice = slice(None)) -> Array:
        u, v, flat = uv[chosen], velocity[chosen], stack.ravel()
        out = np.empty((len(xs), len(ys), len(lags)))
        for k, lag in enumerate(lags):
            x, y = (u + lag * v).T
            columns = [np.clip(np.rint(x + by).astype(np.intp), 0, stack.shape[3] - 1) for by in xs]
            rows = [np.clip(np.rint(y + by).astype(np.intp), 0, stack.shape[2] - 1) * stack.shape[3] for by in ys]
            for j, row in enumerate(rows):
                start = base[chosen] + row
                out[:, j, k] = [flat[start + column].mean() for column in columns]
        return out

    speed = float(np.sqrt(np.mean(np.square(velocity - velocity.mean(axis=0)))))
    moving = speed * _FRAME_S > _LEAST_FLOW_PX
    lags = np.arange(-_REACH_S, _REACH_S + 1e-9, _COARSE_S) if moving else np.zeros(1)
    pixels = np.arange(-_REACH_PX, _REACH_PX + 1e-9, _COARSE_PX)
    grid = scores(pixels, pixels, lags, few)
    best = _highest(grid, pixels, pixels, lags)
    contrast = float((grid.max() - np.median(grid)) / (NORMAL_MAD * np.median(np.abs(grid - np.median(grid))) + 1e-9))
    for size_px, size_s in _FINE:
        steps = np.arange(-3, 4)
        xs, ys = best[0] + steps * size_px, best[1] + steps * size_px
        times = best[2] + (steps if moving else np.zeros(1)) * size_s
        best = _highest(scores(xs, ys, times), xs, ys, times)
    return EdgeShift((float(best[0]), float(best[1])), float(best[2]) if moving else float("nan"), contrast, len(uv))


def _highest(scores: Array, *axes: Array) -> Array:
    """Return where along the `axes` of a grid its `scores` are highest: one value of each."""
    at = np.unravel_index(int(np.argmax(scores)), scores.shape)
    return np.array([axis[k] for axis, k in zip(axes, at, strict=True)])


def _gradients(image: Image) -> Image:
    """Return gradient strengths across x and y (2 x H x W), 0 .. 255, comparable between dull and busy places."""
    smooth = cv2.GaussianBlur(image.astype(np.float32), (0, 0), _BLUR_PX)
    out = np.empty((2, *image.shape), dtype=np.uint8)
    for axis, (dx, dy) in enumerate(((1, 0), (0, 1))):
        strength = np.abs(cv2.Sobel(smooth, cv2.CV_32F, dx, dy))
        usual = cv2.blur(strength, (_USUAL_PX, _USUAL_PX)) + _FLOOR * float(strength.mean()) + 1e-3
        out[axis] = np.minimum(strength * (255.0 / _MOST_GRADIENT) / usual, 255.0)
    return out


def _velocity(edges: DepthEdges, motion: PairMotion, camera: Camera) -> Array:
    """Return the image velocity (px/s) of each edge under the motion, which spans `motion.seconds`."""
    focal, centre = np.array([camera.fx, camera.fy]), np.array([camera.cx, camera.cy])
    points = np.column_stack([(edges.uv - centre) / focal * edges.depth_m[:, None], edges.depth_m])
    xi = 0.5 * se3.log(motion.T_later_earlier)
    seen = []
    for half in (se3.exp(-xi), se3.exp(xi)):
        moved = se3.apply(half, points)
        seen.append(moved[:, :2] / np.maximum(moved[:, 2:], 0.1) * focal)
    return np.asarray((seen[1] - seen[0]) / motion.seconds)
