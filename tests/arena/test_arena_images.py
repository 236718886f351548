import cv2
import numpy as np
import pytest

from odom.geometry.se3 import apply, inverse
from sensors.arena import ArenaFrame, ArenaOptions, frame, render_walk
from sensors.arena import frames as session
from sensors.arena.camera_path import make_walk
from sensors.arena.renderer import Moments
from sensors.arena.row_readout import READOUT_S


def tracked(a: ArenaFrame, b: ArenaFrame) -> tuple[np.ndarray, np.ndarray]:
    """Return corners of `a` and where optical flow finds them in `b`, forward and backward."""
    grey_a, grey_b = (cv2.cvtColor(f.rgb, cv2.COLOR_RGB2GRAY) for f in (a, b))
    p = cv2.goodFeaturesToTrack(grey_a, 500, 0.01, 8)
    q, found, _ = cv2.calcOpticalFlowPyrLK(grey_a, grey_b, p, None, winSize=(15, 15), maxLevel=4)
    r, back, _ = cv2.calcOpticalFlowPyrLK(grey_b, grey_a, q, None, winSize=(15, 15), maxLevel=4)
    good = (found[:, 0] > 0) & (back[:, 0] > 0) & (np.linalg.norm(p - r, axis=(1, 2)) < 0.5)
    return p[good, 0], q[good, 0]


def seen_from(options: ArenaOptions, shot: ArenaFrame, rows: np.ndarray) -> np.ndarray:
    """Return T_world_camera (n x 4 x 4) at the instants at which rows of an image were exposed."""
    readout_s = READOUT_S if options.faults else 0.0
    t = (shot.stamp - options.start) * 1e-9 + (rows / options.camera.height - 1.0) * readout_s
    return np.stack([make_walk(options).T_world_camera(float(at)) for at in t])


@pytest.mark.parametrize(
    "options",
    [
        ArenaOptions(faults=False),
        ArenaOptions(),
        ArenaOptions(distortion=True, seed=1),
        ArenaOptions(half=True),
        ArenaOptions(sensor="kinect2"),
    ],
    ids=["ideal", "kinect1", "bent lens", "half size", "kinect2"],
)
def test_corners_move_as_depth_and_truth_say(options: ArenaOptions) -> None:
    """Colour, depth, calibration, stamps and truth agree: a corner is found where its 3-D point goes."""
    camera = options.camera
    a, b = frame(options, 400), frame(options, 402)
    uv_a, uv_b = tracked(a, b)
    straight = uv_a
    if camera.distortion:
        lens = np.array(camera.distortion)
        straight = cv2.undistortPoints(uv_a[:, None], camera.matrix, lens, P=camera.matrix)[:, 0]
    column, row = np.rint(uv_a).astype(int).T
    z = a.depth_mm[row, column] / 1000.0
    rays = np.column_stack([(straight - (camera.cx, camera.cy)) / (camera.fx, camera.fy), np.ones(len(z))])
    motion = np.linalg.inv(seen_from(options, b, uv_b[:, 1])) @ seen_from(options, a, uv_a[:, 1])
    points = np.stack([apply(T, ray * depth) for T, ray, depth in zip(motion, rays, z, strict=True)])[z > 0]
    lens = np.array(camera.distortion) if camera.distortion else None
    expected, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), camera.matrix, lens)
    error = expected[:, 0] - uv_b[z > 0]
    assert len(error) > 80
    assert np.linalg.norm(uv_a - uv_b, axis=1).mean() > 2
    assert np.median(np.linalg.norm(error, axis=1)) < 0.2
    assert np.abs(np.median(error, axis=0)).max() < 0.08


def test_a_frame_is_the_same_bytes_in_any_order_and_from_a_room_built_anew() -> None:
    options = ArenaOptions()
    first = [frame(options, k) for k in (10, 500, 3)]
    session._scene.cache_clear()
    session._tiles.cache_clear()
    again = {k: frame(options, k) for k in (3, 10, 500)}
    for shot in first:
        other = again[shot.index]
        assert shot.rgb.tobytes() == other.rgb.tobytes()
        assert shot.depth_mm.tobytes() == other.depth_mm.tobytes()
        assert (shot.stamp, shot.depth_stamp) == (other.stamp, other.depth_stamp)


def test_the_last_frame_shows_what_the_first_showed(ideal: ArenaOptions) -> None:
    a, b = frame(ideal, 0), frame(ideal, 960)
    assert np.array_equal(a.rgb, b.rgb)
    assert np.array_equal(a.depth_mm, b.depth_mm)


def test_pictures_have_light_shade_and_detail(faulty: ArenaOptions) -> None:
    for index in (0, 300, 600):
        grey = cv2.cvtColor(frame(faulty, index).rgb, cv2.COLOR_RGB2GRAY)
        assert 70 < grey.mean() < 170
        assert grey.std() > 30
        assert (grey > 250).mean() < 0.05
        assert len(cv2.goodFeaturesToTrack(grey, 1000, 0.005, 6)) >= 400


def test_fast_rotation_blurs_the_picture() -> None:
    """The same view is sharper with a shutter that opens for an instant."""
    still = ArenaOptions(faults=False)
    moving = ArenaOptions()
    walk = session.make_walk(still)
    turn = [
        np.linalg.norm(walk.T_world_camera(k / 30)[:3, 2] - walk.T_world_camera((k + 1) / 30)[:3, 2])
        for k in range(960)
    ]
    fast = int(np.argmax(turn))
    sharp, blurred = (
        cv2.Sobel(
            cv2.GaussianBlur(cv2.cvtColor(frame(o, fast).rgb, cv2.COLOR_RGB2GRAY), (0, 0), 1.0), cv2.CV_32F, 1, 0
        ).std()
        for o in (still, moving)
    )
    assert blurred < 0.95 * sharp


def test_colour_and_depth_are_taken_at_different_instants(faulty: ArenaOptions) -> None:
    apart = [(session.depth_time(faulty, k) - session.color_time(faulty, k)) * 1000 for k in range(0, faulty.frames, 7)]
    assert min(apart) > 0
    assert max(apart) < 1000 / 30 / 2
    assert max(apart) - min(apart) > 3


@pytest.mark.parametrize("kind", ["frames", "color", "depth"])
def test_a_blackout_hides_what_it_names(kind: str) -> None:
    options = ArenaOptions.from_texts(
        {"blackout": kind, "blackout_start_s": "0.2", "blackout_s": "0.1", "seconds": "0.5"}
    )
    shots = list(render_walk(options))
    dark = [f.index for f in shots if f.rgb.mean() < 8]
    blind = [f.index for f in shots if not f.depth_mm.any()]
    missing = sorted(set(range(15)) - {f.index for f in shots})
    assert {"frames": missing, "color": dark, "depth": blind}[kind] == [6, 7, 8]
    assert sum(map(bool, (missing, dark, blind))) == 1


def test_the_corridor_repeats_itself_to_the_last_pixel() -> None:
    from sensors.arena.depth_to_color import intrinsics
    from sensors.arena.rooms import BAY_M

    options = ArenaOptions(walk="corridor", faults=False)
    scene = session._scene("corridor", 1, 0, False)
    T = session.make_walk(options).T_world_camera(7.0)
    further = T.copy()
    further[0, 3] += BAY_M
    K, moments = intrinsics(options.camera), Moments(np.zeros(4))
    views = [scene.color(np.stack([inverse(t)] * 4), K, (480, 640), moments)[0] for t in (T, further)]
    pictures = [session.unpack(v).astype(int) for v in views]
    assert np.percentile(np.abs(pictures[0] - pictures[1]), 99.5) <= 2
    assert pictures[0].std() > 25


def test_joined_rooms_are_two_different_rooms_far_apart() -> None:
    options = ArenaOptions(walk="joined")
    before, after = frame(options, 960), frame(options, 961)
    assert np.linalg.norm(after.T_world_camera[:3, 3] - before.T_world_camera[:3, 3]) > 10
    assert np.abs(before.rgb.astype(int) - after.rgb).mean() > 5
    assert (before.depth_mm != after.depth_mm).mean() > 0.3
