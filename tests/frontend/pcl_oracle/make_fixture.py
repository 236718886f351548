"""Makes tests/frontend/pcl_oracle/fixture.npz: two clouds with key points and descriptors of the Point Cloud Library.

    apt-get install g++ pkg-config libpcl-dev
    python tests/frontend/pcl_oracle/make_fixture.py

The clouds are a part of the simulated laboratory as a Kinect v1 sees it (seed 1, frame 160), and made-up painted bodies
(seed 7); what was used is in the fixture's `provenance`.
"""

import json
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from odom.frontend.camera.lens import Lens
from odom.frontend.cloud_features.cloud import Cloud, cloud_of
from sensors.arena.frames import frame
from sensors.arena.options import ArenaOptions

HERE = Path(__file__).parent
DESCRIBED = 50
"""Points of each cloud, its first ones, that are described."""
SIFT = {"octaves": 3, "scales": 3, "sigma_m": 0.02, "contrast": 1.0}
RADIUS_M, NORMAL_RADIUS_M = 0.15, 0.05


def laboratory() -> Cloud:
    options = ArenaOptions(seed=1)
    shot = frame(options, 160)
    depth_mm = shot.depth_mm.copy()
    depth_mm[:, :200] = depth_mm[:, 420:] = depth_mm[:120] = 0
    depth_mm[depth_mm > 3000] = 0
    return cloud_of(shot.rgb, depth_mm, Lens.of(options.camera).rays)


def bodies() -> Cloud:
    """Points on a sphere, a cylinder and a wall, painted with soft spots."""
    rng = np.random.default_rng(7)
    u, v = rng.uniform(0, 1, (2, 60_000))
    up = 2 * u - 1
    ring = np.sqrt(1 - up**2)
    ball = 0.3 * np.column_stack([ring * np.cos(2 * np.pi * v), up, ring * np.sin(2 * np.pi * v)]) + [-0.3, 0, 1.3]
    turn = np.pi * v
    pipe = np.column_stack([0.4 + 0.15 * np.cos(turn), u - 0.5, 1.3 - 0.15 * np.sin(turn)])
    wall = np.column_stack([1.8 * u - 0.9, v - 0.5, np.full(len(u), 1.7)])
    points = np.concatenate([ball[ball[:, 2] < 1.32], pipe, wall])
    points += rng.normal(0, 0.0015, points.shape)
    middles, tints = rng.uniform((-0.9, -0.5, 1), (0.9, 0.5, 1.7), (220, 3)), rng.uniform(-110, 110, (220, 3))
    widths = rng.uniform(0.02, 0.08, 220)
    colors = np.full(points.shape, 128.0)
    for middle, tint, width in zip(middles, tints, widths, strict=True):
        colors += np.exp(-0.5 * ((points - middle) ** 2).sum(axis=1) / width**2)[:, None] * tint
    return Cloud(points, np.clip(colors, 0, 255))


def rows_of(cloud: Cloud, seed: int) -> np.ndarray:
    """Return the thinned cloud as the program reads it, in an order by chance: the first rows are to be described."""
    thin = cloud.thinned(SIFT["sigma_m"] / 2)
    rows = np.column_stack([thin.points, np.rint(thin.colors), thin.normals(NORMAL_RADIUS_M)])
    rows[:, 6:] = rows[:, 6:].astype(np.float16)  # as they are kept
    rows = rows[np.isfinite(rows).all(axis=1)]
    return np.random.default_rng(seed).permutation(rows)[:9000].astype(np.float32)


def main() -> None:
    kept: dict[str, np.ndarray] = {}
    with tempfile.TemporaryDirectory() as folder:
        program = Path(folder) / "oracle"
        names = ["pcl_keypoints", "pcl_features", "pcl_filters", "pcl_search", "pcl_kdtree", "pcl_common"]
        flags = subprocess.run(["pkg-config", "--cflags", "--libs", *names], check=True, capture_output=True, text=True)
        command = ["g++", "-O2", "-std=c++17", str(HERE / "oracle.cpp"), "-o", str(program), *flags.stdout.split()]
        subprocess.run(command, check=True)
        for seed, (name, cloud) in enumerate({"laboratory": laboratory(), "bodies": bodies()}.items()):
            rows = rows_of(cloud, seed)
            given, made = Path(folder) / "given", Path(folder) / "made"
            counts = np.array([len(rows), DESCRIBED, SIFT["octaves"], SIFT["scales"]], np.int32)
            numbers = np.array([SIFT["sigma_m"], SIFT["contrast"], RADIUS_M], np.float32)
            given.write_bytes(counts.tobytes() + numbers.tobytes() + rows.tobytes())
            subprocess.run([str(program), str(given), str(made)], check=True)
            found = np.fromfile(made, np.float32, offset=4)
            count = int(np.fromfile(made, np.int32, count=1)[0])
            described = found[4 * count :].reshape(DESCRIBED, 9 + 1344)
            kept[f"{name}_points"], kept[f"{name}_colors"] = rows[:, :3], rows[:, 3:6].astype(np.uint8)
            kept[f"{name}_normals"] = rows[:, 6:].astype(np.float16)
            kept[f"{name}_keypoints"] = found[: 4 * count].reshape(count, 4)
            kept[f"{name}_frames"] = described[:, :9].reshape(-1, 3, 3)
            kept[f"{name}_descriptors"] = described[:, 9:].astype(np.float16)
    version = subprocess.run(["pkg-config", "--modversion", "pcl_common"], check=True, capture_output=True, text=True)
    provenance = {
        "library": f"PCL {version.stdout.strip()} of Debian (libpcl-dev)",
        "program": "tests/frontend/pcl_oracle/oracle.cpp",
        "sift": SIFT,
        "cshot_radius_m": RADIUS_M,
        "described": f"the first {DESCRIBED} points of each cloud",
    }
    kept["provenance"] = np.array(json.dumps(provenance))
    np.savez_compressed(HERE / "fixture.npz", **kept)


if __name__ == "__main__":
    main()
