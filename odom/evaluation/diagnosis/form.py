"""Basic checks of images and calibration: sizes, missing files, repeated images, distortion coefficients."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from odom.evaluation.diagnosis.finding import Finding, Verdict
from odom.evaluation.diagnosis.recording import NO_FILE, NOT_DEPTH, NOT_METRES, OTHER_FORMAT, Recording
from odom.frame import Camera, RgbdFrame
from odom.frontend.camera.rays import undistorted

_REFUSED_SHARE = 0.03
"""Share of a stream's images that may be unusable: single damaged files do not spoil a recording."""
_REPEATED_SHARE = 0.1
"""Share of images equal to the one before from which a stream counts as stuck: noise changes every true image."""
_ONE_VALUE_SHARE = 0.9
"""Share of a depth image's pixels of the same value: a sensor's noise spreads even a wall over several."""
_CLIPPED_SHARE, _BEFORE_CLIP = 0.02, 0.9
"""Depth is clipped where this share of the pixels has the greatest value, and fewer lie between this share of it and
it: of a true wall, noise leaves few at any one millimetre."""
_SAME_SHARE = 0.9
"""Share of the images that have the same greatest depth if it is clipped."""
_ROUND_TRIP_PX, _BENT_SHARE, _FARTHEST_SHIFT = 1.0, 0.02, 0.35
"""A lens's formula must lead back to the pixel it came from, but for a share of the image; and may shift a pixel by
this share of the image's width. The lenses of Kinects shift by 3 %, wide ones by 20 %."""
_GRID = 24
"""Pixels each way at which a lens is tried: fewer miss where it folds, more are slower."""
_ADVICE = {
    NO_FILE: "the list names files that are not there: copy them too, or take their lines out of the list",
    NOT_DEPTH: "such images hold no distances: export depth as 16-bit PNG; or rgb.txt and depth.txt are swapped",
    NOT_METRES: "half of it is beyond 65.5 m: divide by 1000, or write 16-bit PNG in millimetres",
    OTHER_FORMAT: "convert the images to PNG, depth in 16 bits (or .npy), and the names in the lists",
}


def judge_sizes(recording: Recording) -> list[Finding]:
    """Return what is wrong with the sizes of images and calibration; empty when they agree."""
    color, depth, camera = recording.color_size, recording.depth_size, recording.camera
    found = []
    if color and camera and (camera.width, camera.height) != color:
        value = f"for {camera.width} x {camera.height} pixels, colour has {color[0]} x {color[1]}"
        advice = "give the calibration of this image size, or scale its size, fx, fy, cx and cy by the same factor"
        found.append(Finding("calibration size", value, Verdict.BAD, advice))
    if color and depth and depth != color:
        value = f"{depth[0]} x {depth[1]} pixels, colour has {color[0]} x {color[1]}"
        advice = "depth must be registered to colour, pixel by pixel: record the registered depth at colour's size"
        found.append(Finding("depth size", value, Verdict.BAD, advice))
    return found


def judge_refused(recording: Recording) -> list[Finding]:
    """Return which images could not be used, and why; empty when hardly any."""
    came = {"colour": len(recording.color_stamps), "depth": len(recording.depth_stamps)}
    found = []
    for (stream, why), count in recording.refused.items():
        if count > _REFUSED_SHARE * max(count, came.get(stream, 0)):
            value = f"{count} cannot be used: {why}"
            found.append(Finding(f"{stream} images", value, Verdict.BAD, advice_on_refused(why)))
    return found


def advice_on_refused(why: str) -> str:
    """Return what to do about images that cannot be used for this reason, as a source says it."""
    return _ADVICE.get(why, "the images are damaged or of a kind that is not read: make them again")


def judge_change(frames: Sequence[RgbdFrame]) -> list[Finding]:
    """Return which streams repeat the same image, or show the same depth everywhere, or up to the same depth."""
    found = []
    depth_mm = [frame.depth_mm[::8, ::8] for frame in frames]
    if value_mm := _one_value(depth_mm):
        advice = "no sensor measures that: it is a test image, or the conversion lost the values"
        found.append(Finding("depth images", f"every pixel has {value_mm} mm", Verdict.BAD, advice))
        depth_mm = []
    elif clip_mm := _clip(depth_mm):
        advice = "write 0 where nothing is measured: as it is, what lies farther away is taken for a wall there"
        found.append(Finding("depth images", f"all that is farther is said to be at {clip_mm} mm", Verdict.BAD, advice))
    for name, repeats in (("colour", _repeats([f.color[::8, ::8] for f in frames])), ("depth", _repeats(depth_mm))):
        if repeats.any() and float(repeats.mean()) > _REPEATED_SHARE:
            value = f"{repeats.sum()} of {len(repeats)} are the same as the one before"
            advice = f"the driver repeats its {name} image: start it again, and look for a busy USB port or CPU"
            found.append(Finding(f"{name} images", value, Verdict.BAD, advice))
    return found


def _repeats(images: Sequence[NDArray[Any]]) -> NDArray[np.bool_]:
    """Return which images, from the second on, equal the one before; black ones are another fault."""
    return np.array([image.any() and np.array_equal(before, image) for before, image in pairwise(images)], dtype=bool)


def _one_value(depths_mm: Sequence[NDArray[np.uint16]]) -> int:
    """Return the depth that nearly every pixel of the usual image has, 0 without one."""
    shares = [float(np.bincount(depth.ravel()).max()) / depth.size for depth in depths_mm]
    return int(np.median(np.concatenate(depths_mm))) if float(np.median(shares)) > _ONE_VALUE_SHARE else 0


def _clip(depths_mm: Sequence[NDArray[np.uint16]]) -> int:
    """Return the depth at which images are clipped, to which all that is farther was set; 0 where they are not."""
    seen_mm = [depth[depth > 0] for depth in depths_mm]
    greatest = [int(depth.max(initial=0)) for depth in seen_mm]
    clip_mm, every = int(np.median(greatest)), np.concatenate(seen_mm)
    if np.mean(np.array(greatest) == clip_mm) < _SAME_SHARE:
        return 0
    clipped = np.count_nonzero(every == clip_mm)
    before = np.count_nonzero((every > _BEFORE_CLIP * clip_mm) & (every < clip_mm))
    pixels = sum(depth.size for depth in depths_mm)
    return clip_mm if clipped > before and clipped > _CLIPPED_SHARE * pixels else 0


def judge_lens(camera: Camera) -> Finding:
    """Judge whether the distortion formula can be undone within the image: a wild one bends it over itself."""
    key = "distortion"
    if not camera.distortion:
        return Finding(key, "none", Verdict.GOOD)
    x, y = np.meshgrid(np.linspace(0, camera.width - 1, _GRID), np.linspace(0, camera.height - 1, _GRID))
    pixels = np.column_stack([x.ravel(), y.ravel()])
    coefficients = np.array(camera.distortion)
    rays = undistorted(camera, pixels)
    points = np.column_stack([rays, np.ones(len(rays))])
    back = cv2.projectPoints(points, np.zeros(3), np.zeros(3), camera.matrix, coefficients)[0].reshape(-1, 2)
    straight = rays * (camera.fx, camera.fy) + (camera.cx, camera.cy)
    lost = ~(np.linalg.norm(back - pixels, axis=1) < _ROUND_TRIP_PX)
    shift = float(np.max(np.linalg.norm(straight - pixels, axis=1)[~lost], initial=0.0))
    value = f"shifts pixels by up to {shift:.0f} px"
    if lost.mean() > _BENT_SHARE:
        value = f"cannot be undone in {lost.mean():.0%} of the image"
    advice = (
        "the distortion coefficients are not this lens's: check their order (k1 k2 p1 p2 k3), calibrate again, or "
        "leave them out"
    )
    return Finding.judged(key, value, lost.mean() > _BENT_SHARE or shift > _FARTHEST_SHIFT * camera.width, advice)
