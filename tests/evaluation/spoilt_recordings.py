"""Recordings for the study of the doctor: good stretches of real and simulated walks, and twenty ways to spoil one."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np

from odom.evaluation.diagnosis import Recording
from odom.frame import RgbdFrame

Rng = np.random.Generator


@dataclass(frozen=True)
class Fault:
    """How a recording is spoilt, the checks that must call it bad (and no other may), and a word of the remedy.

    `by_truth` says that only truth shows it; `scale` is the true ratio of measured to true depth.
    """

    spoil: Callable[[Recording, Rng], Recording]
    keys: frozenset[str]
    remedy: str
    by_truth: bool = False
    scale: float = 1.0


def _depth(r: Recording, change: Callable[[np.ndarray], np.ndarray]) -> Recording:
    return replace(r, frames=tuple(replace(f, depth_mm=change(f.depth_mm)) for f in r.frames))


def _color(r: Recording, change: Callable[[np.ndarray], np.ndarray]) -> Recording:
    return replace(r, frames=tuple(replace(f, color=change(f.color)) for f in r.frames))


def _only(r: Recording, frames: tuple[RgbdFrame, ...]) -> Recording:
    color = np.array([f.stamp for f in frames], dtype=np.int64)
    return replace(r, frames=frames, color_stamps=color, depth_stamps=np.array([f.depth_stamp for f in frames]))


def _scaled(factor: float) -> Callable[[np.ndarray], np.ndarray]:
    return lambda depth: np.minimum(np.rint(factor * depth), 65535).astype(np.uint16)


def _camera(r: Recording, **values: object) -> Recording:
    assert r.camera is not None
    return replace(r, camera=replace(r.camera, **values))


def shifted(r: Recording, rng: Rng) -> Recording:
    """Depth that is not registered: moved by a hundredth of the width and more, to one side."""
    by = round(float(rng.uniform(0.012, 0.03)) * 640) * int(rng.choice([-1, 1]))
    return _depth(r, lambda depth: np.roll(depth, by, axis=1))


def late(r: Recording, rng: Rng) -> Recording:
    """Depth of two or three frames ago under the stamp of now."""
    n = int(rng.integers(2, 4))
    pairs = zip(r.frames[n:], r.frames[:-n], strict=True)
    frames = tuple(replace(new, depth_mm=old.depth_mm) for new, old in pairs)
    return replace(r, frames=frames)


def lossy(r: Recording, rng: Rng) -> Recording:
    """A third to a half of the frames is lost."""
    kept = rng.random(len(r.frames)) > rng.uniform(0.33, 0.5)
    return _only(r, tuple(f for f, keep in zip(r.frames, kept, strict=True) if keep))


def slow(r: Recording, rng: Rng) -> Recording:
    """Every second or third frame only."""
    return _only(r, r.frames[:: int(rng.integers(2, 4))])


def depth_lossy(r: Recording, rng: Rng) -> Recording:
    """Half of the depth images is lost: these colour images have none."""
    kept = set(rng.permutation(r.depth_stamps)[: len(r.depth_stamps) // 2].tolist())
    frames = tuple(
        f if f.depth_stamp in kept else replace(f, depth_stamp=f.stamp, depth_mm=np.zeros_like(f.depth_mm))
        for f in r.frames
    )
    return replace(r, frames=frames, depth_stamps=np.array(sorted(kept), dtype=np.int64))


def two_clocks(r: Recording, rng: Rng) -> Recording:
    """Depth is stamped by a clock minutes off, so that nothing pairs."""
    apart = np.int64(rng.uniform(20, 300) * 1e9)
    frames = tuple(replace(f, depth_stamp=f.stamp, depth_mm=np.zeros_like(f.depth_mm)) for f in r.frames)
    return replace(r, frames=frames, depth_stamps=r.depth_stamps + apart)


def fx_wrong(r: Recording, rng: Rng) -> Recording:
    assert r.camera is not None
    return _camera(r, fx=r.camera.fx * float(rng.uniform(1.15, 1.3)))


def both_wrong(r: Recording, rng: Rng) -> Recording:
    assert r.camera is not None
    factor = float(rng.choice([rng.uniform(0.72, 0.82), rng.uniform(1.2, 1.35)]))
    return _camera(r, fx=r.camera.fx * factor, fy=r.camera.fy * factor)


def centre_wrong(r: Recording, rng: Rng) -> Recording:
    assert r.camera is not None
    return _camera(r, cx=r.camera.cx * float(rng.uniform(0.45, 0.65)))


def of_another_size(r: Recording, rng: Rng) -> Recording:
    assert r.camera is not None
    c = r.camera
    half = replace(c, width=c.width // 2, height=c.height // 2, fx=c.fx / 2, fy=c.fy / 2, cx=c.cx / 2, cy=c.cy / 2)
    return replace(r, camera=half, frames=())


def wild(r: Recording, rng: Rng) -> Recording:
    k = rng.uniform(2, 6)
    return _camera(r, distortion=(float(k), float(-3 * k), 0.2, 0.3, 5.0))


def noisy(r: Recording, rng: Rng) -> Recording:
    """Depth that scatters by 2 to 3 % of itself, pixel by pixel."""
    share = rng.uniform(0.02, 0.03)

    def spread(depth: np.ndarray) -> np.ndarray:
        factor = 1.0 + share * rng.standard_normal(depth.shape, dtype=np.float32)
        return np.clip(np.rint(depth * factor), 0, 65535).astype(np.uint16)

    return _depth(r, spread)


def empty(r: Recording, rng: Rng) -> Recording:
    """Nine tenths of the depth are missing, in blocks, as in sunlight."""
    height, width = r.frames[0].depth_mm.shape
    coarse = (rng.random((height // 20, width // 20)) < 0.9).astype(np.uint8)
    gone = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_NEAREST).astype(bool)
    return _depth(r, lambda depth: np.where(gone, 0, depth).astype(np.uint16))


def clipped(r: Recording, rng: Rng) -> Recording:
    """What is farther than three fifths of the depths is said to be there, as by simulators."""
    some = np.concatenate([f.depth_mm[::8, ::8].ravel() for f in r.paired])
    end = np.uint16(np.quantile(some[some > 0], 0.6))
    return _depth(r, lambda depth: np.minimum(depth, end))


def stuck(r: Recording, rng: Rng) -> Recording:
    """Each depth image comes three times."""
    frames = r.frames
    return replace(r, frames=tuple(replace(f, depth_mm=frames[k // 3 * 3].depth_mm) for k, f in enumerate(frames)))


def color_stuck(r: Recording, rng: Rng) -> Recording:
    frames = r.frames
    return replace(r, frames=tuple(replace(f, color=frames[k // 3 * 3].color) for k, f in enumerate(frames)))


FAULTS: dict[str, Fault] = {
    "depth not registered": Fault(shifted, frozenset({"depth registration"}), "registration in the driver"),
    "depth late": Fault(late, frozenset({"depth time"}), "synchronisation"),
    "frames lost": Fault(lossy, frozenset({"colour frames", "depth frames"}), "USB port"),
    "too slow": Fault(slow, frozenset({"colour frames", "depth frames"}), "30 frames a second"),
    "depth frames lost": Fault(depth_lossy, frozenset({"depth frames"}), "USB port"),
    "two clocks": Fault(two_clocks, frozenset({"pairs"}), "to the stamps of depth"),
    "fx wrong": Fault(fx_wrong, frozenset({"focal length"}), "odom calibrate"),
    "fx and fy wrong": Fault(both_wrong, frozenset({"focal length"}), "odom calibrate"),
    "centre wrong": Fault(centre_wrong, frozenset({"focal length"}), "odom calibrate"),
    "calibration of another size": Fault(of_another_size, frozenset({"calibration size"}), "image size"),
    "wild distortion": Fault(wild, frozenset({"distortion"}), "k1 k2"),
    "depth a tenth too large": Fault(
        lambda r, rng: _depth(r, _scaled(1.1)), frozenset({"depth scale"}), "multiply", True, 1.1
    ),
    "depth a tenth too small": Fault(
        lambda r, rng: _depth(r, _scaled(0.9)), frozenset({"depth scale"}), "multiply", True, 0.9
    ),
    "depth five times": Fault(
        lambda r, rng: _depth(r, _scaled(5.0)), frozenset({"depth scale"}), "multiply", scale=5.0
    ),
    "depth in centimetres": Fault(
        lambda r, rng: _depth(r, lambda d: (d // 10).astype(np.uint16)), frozenset({"depth scale"}), "unit"
    ),
    "depth constant": Fault(
        lambda r, rng: _depth(r, lambda d: np.full_like(d, 1500)), frozenset({"depth images"}), "test image"
    ),
    "depth clipped": Fault(clipped, frozenset({"depth images"}), "write 0"),
    "depth stuck": Fault(stuck, frozenset({"depth images"}), "repeats"),
    "colour stuck": Fault(color_stuck, frozenset({"colour images"}), "repeats"),
    "depth noisy": Fault(noisy, frozenset({"depth noise"}), "noisier"),
    "depth missing": Fault(empty, frozenset({"valid depth"}), "0.6 .. 4 m"),
    "dark": Fault(lambda r, rng: _color(r, lambda c: c // 32), frozenset({"exposure"}), "light"),
    "out of focus": Fault(
        lambda r, rng: _color(r, lambda c: np.asarray(cv2.GaussianBlur(c, (0, 0), 9), np.uint8)),
        frozenset({"sharpness"}), "focus the lens",
    ),
}  # fmt: skip
