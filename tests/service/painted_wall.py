"""A TUM folder of a camera that moves along a painted wall: small, quick to draw, and easy to track."""

from pathlib import Path

import cv2
import numpy as np

SIZE = 320, 240
CAMERA = """image_width: 320
image_height: 240
camera_matrix: {data: [262.5, 0, 159.5, 0, 262.5, 119.5, 0, 0, 1]}
depth_scale: 5000
"""


def write_wall(folder: Path, frames: int = 60, depth_scale: float = 5000.0, depth_m: float = 2.0) -> Path:
    """Colour at 30 Hz, depth 5 ms later, truth at 100 Hz; the camera moves 2 px, 15 mm, a frame to the right."""
    width, height = SIZE
    texture = np.random.default_rng(0).integers(0, 256, (40, 120), dtype=np.uint8)
    wall = cv2.resize(texture, (width + 2 * frames, height), interpolation=cv2.INTER_CUBIC)
    for name in ("rgb", "depth"):
        (folder / name).mkdir(parents=True)
        lines = (f"{100 + i / 30 + 0.005 * (name == 'depth'):.6f} {name}/{i:03}.png\n" for i in range(frames))
        (folder / f"{name}.txt").write_text("".join(lines))
    depth = np.full((height, width), round(depth_m * depth_scale), dtype=np.uint16)
    for i in range(frames):
        cv2.imwrite(str(folder / "rgb" / f"{i:03}.png"), np.dstack([wall[:, 2 * i : 2 * i + width]] * 3))
        cv2.imwrite(str(folder / "depth" / f"{i:03}.png"), depth)
    times = np.arange(99.9, 100.1 + frames / 30, 0.01)
    x = 2 * depth_m / 262.5 * 30 * (times - 100)
    (folder / "groundtruth.txt").write_text(
        "".join(f"{t:.4f} {at:.6f} 0 0 0 0 0 1\n" for t, at in zip(times, x, strict=True))
    )
    return folder
