"""Write a recording as a TUM folder with bodies that walk to and fro: `python -m tests.paint_passers_by SOURCE OUT`.

`odom run OUT` reads it. Beside the images, `mask/` has a PNG for each colour image, white where a body is.
"""

import argparse
from itertools import islice
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from odom import Camera, RgbdRecording, Trajectory, read_recording
from odom.evaluation.painter import Painter, anchor_in_world
from odom.evaluation.passers_by import nearer_than, passers_by
from odom.frontend.camera.lens import Lens
from sensors.calibration_file import TUM_DEPTH_SCALE

_TABLE = np.rint(np.arange(65536) * TUM_DEPTH_SCALE / 1000.0).clip(0, 65535).astype(np.uint16)


def write(recording: RgbdRecording, out: Path, painter: Painter, truth: Trajectory | None) -> tuple[int, float]:
    """Write the painted folder; return its frames, and the mean share of the view that moves."""
    for name in ("rgb", "depth", "mask"):
        (out / name).mkdir(parents=True, exist_ok=True)
    lists: dict[str, dict[int, str]] = {"rgb": {}, "depth": {}, "mask": {}}
    shares = []
    for frame in recording:
        painted, mask = painter.paint(frame)
        shares.append(mask.mean())
        color = painted.color if painted.color.ndim == 2 else painted.color[..., ::-1]
        images = {
            "rgb": (frame.stamp, "jpg", color, [cv2.IMWRITE_JPEG_QUALITY, 92]),
            "depth": (frame.depth_stamp, "png", _TABLE[painted.depth_mm], [cv2.IMWRITE_PNG_COMPRESSION, 1]),
            "mask": (frame.stamp, "png", mask.astype(np.uint8) * 255, []),
        }
        for name, (stamp, ending, image, how) in images.items():
            lists[name][stamp] = f"{name}/{stamp // 10**9}.{stamp % 10**9:09d}.{ending}"
            cv2.imwrite(str(out / lists[name][stamp]), image, how)
    for name, files in lists.items():
        text = "".join(f"{s // 10**9}.{s % 10**9:09d} {files[s]}\n" for s in sorted(files))
        (out / f"{name}.txt").write_text(text)
    _write_camera(out / "camera.yaml", recording.camera)
    if truth is not None:
        rows = zip(truth.stamps.tolist(), truth.T_world_body, strict=True)
        lines = (
            f"{s // 10**9}.{s % 10**9:09d} "
            + " ".join(f"{value:.7f}" for value in (*T[:3, 3], *Rotation.from_matrix(T[:3, :3]).as_quat()))
            for s, T in rows
        )
        (out / "groundtruth.txt").write_text("\n".join(lines) + "\n")
    return len(shares), float(np.mean(shares))


def _write_camera(path: Path, camera: Camera) -> None:
    matrix = ", ".join(f"{value!r}" for value in camera.matrix.ravel().tolist())
    model = "plumb_bob" if len(camera.distortion) <= 5 else "rational_polynomial"
    path.write_text(
        f"image_width: {camera.width}\nimage_height: {camera.height}\n"
        f"camera_matrix: {{rows: 3, cols: 3, data: [{matrix}]}}\ndistortion_model: {model}\n"
        f"distortion_coefficients: {{data: {list(camera.distortion)}}}\ndepth_scale: {TUM_DEPTH_SCALE}\n"
    )


def main() -> None:
    """Read the command line, paint and say what was written."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("source", type=Path)
    parser.add_argument("out", type=Path, help="a folder that is replaced")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=1)
    parser.add_argument("--share", type=float, default=0.33, help="of the image's width, of the widest body")
    parser.add_argument("--speed", type=float, default=0.6, help="m/s")
    parser.add_argument("--distance", type=float, default=None, help="m; without it, before most of the scene")
    parser.add_argument("--start", type=float, default=0.0, help="seconds")
    parser.add_argument("--end", type=float, default=None, help="seconds")
    parser.add_argument("--carried", action="store_true", help="bodies follow the camera instead of the world")
    given = parser.parse_args()
    recording = read_recording(given.source, start=given.start, end=given.end)
    first = list(islice(recording, 40))
    distance = given.distance or nearer_than(first[::10])
    truth = recording.truth()
    camera_truth = truth.get("camera") or truth.get("exact_camera")
    in_world = camera_truth is not None and not given.carried
    painter = Painter(
        recording.camera,
        passers_by(
            recording.camera, distance, count=given.count, share=given.share, speed_m_s=given.speed, seed=given.seed
        ),
        first[0].stamp,
        anchor_in_world(camera_truth) if in_world and camera_truth is not None else lambda stamp: np.eye(4),
        Lens.of(recording.camera),
        given.seed,
    )
    if given.out.exists():
        raise SystemExit(f"{given.out} is there already: name a new folder")
    frames, share = write(recording, given.out, painter, camera_truth)
    print(f"{given.out}: {frames} frames, {share:.0%} of the view moves, bodies at {distance:.2f} m")


if __name__ == "__main__":
    main()
