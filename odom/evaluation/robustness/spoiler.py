"""Degrades a recording: pure functions of its calibration, its stamps and its frames."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum, unique

import numpy as np

from odom.evaluation.trajectory import Trajectory
from odom.frame import Camera, RgbdFrame, Stamp
from odom.frontend.camera.rolling_shutter import ShutterTiming


@unique
class Stream(Enum):
    """The two streams of images, each with stamps of its own."""

    COLOR = 0
    DEPTH = 1


@dataclass(frozen=True)
class Spoiler:
    """Changes of the calibration, of each image's stamp (before images are paired) and of each frame (None: dropped).

    They depend on what they are given alone, so equal frames are spoilt equally in any order. `light_returns` gives the
    stamp from which a frame is visible again: the end of the black-out around it, else its own stamp.
    """

    camera: Callable[[Camera], Camera] = lambda camera: camera
    stamp: Callable[[Stream, Stamp], Stamp] = lambda stream, stamp: stamp
    frame: Callable[[RgbdFrame], RgbdFrame | None] = lambda frame: frame
    light_returns: Callable[[Stamp], Stamp] = lambda stamp: stamp


UNSPOILT = Spoiler()


@dataclass(frozen=True, eq=False)
class Scene:
    """What a spoiler may know of a recording: calibration, first stamp, and the camera's true path (for passers-by).

    Most of what is seen lies beyond `near_m`. All random numbers come from `seed`. The path that was `estimated`, with
    the shutter's `timing`, is smoother than that of motion capture: what is painted by it stands still in the images.
    """

    seed: int
    begin: Stamp
    camera: Camera
    path: Trajectory
    near_m: float
    estimated: Trajectory
    timing: ShutterTiming


def generator(seed: int, stamp: Stamp, stream: Stream = Stream.COLOR) -> np.random.Generator:
    """Return the random generator for one image, by its stamp."""
    return np.random.default_rng([seed, stream.value, abs(stamp)])
