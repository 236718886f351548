"""The picture follows from the messages: which entities, in which bounds, and what bad messages do."""

from collections import Counter
from contextlib import suppress
from pathlib import Path
from unittest.mock import MagicMock

import numpy as np
import pytest
import rerun as rr
from hypothesis import given
from hypothesis import strategies as st
from made_up_device import BEGIN, PERIOD_NS, SMALL_CAMERA, T_WORLD_MAP, MadeUp, messages, true_pose
from rerun.chunk import RrdReader

from odom.errors import WireError
from odom.frame import Camera, Stamp
from odom.frontend.matching.moving_surfaces import MovingCells
from odom.geometry import se3
from odom.service.estimate_messages import moving_message
from odom.viewer import ViewerSettings, entities, palette
from odom.viewer.entities import EntityUpdate, log_to, update
from odom.viewer.keyframe_clouds import KeyframeClouds, back_project
from odom.viewer.scene import Scene
from odom.viewer.truth_alignment import in_map
from odom.viewer.viewer_process import Viewer
from odom.wire import Message, Topics, codec, truth
from odom.wire.delivery import Delivery

TOPICS = Topics("cam0")


def _scene(**settings: int) -> Scene:
    return Scene(TOPICS, ViewerSettings(**settings))


def _play(scene: Scene, options: MadeUp) -> list[EntityUpdate]:
    return [item for frame in messages(options, TOPICS) for message in frame for item in scene.handle(message)]


def _batch(item: EntityUpdate, component: str) -> list:
    for part in item.parts:
        for batch in part.as_component_batches():
            if str(batch.component_descriptor()).split(":")[-1].split("#")[0].strip() == component:
                return batch.as_arrow_array().to_pylist()
    raise AssertionError(f"{item.path} has no {component}")


def _last(drawn: list[EntityUpdate], path: str) -> EntityUpdate:
    return next(item for item in reversed(drawn) if item.path == path)


@pytest.fixture(scope="module")
def played() -> tuple[Scene, list[EntityUpdate]]:
    scene = _scene()
    return scene, _play(scene, MadeUp(frames=300, drift_m=0.2, camera=SMALL_CAMERA))


def test_the_last_drawing_has_the_trajectories_and_nothing_slow(played: tuple[Scene, list[EntityUpdate]]) -> None:
    paths = {item.path for item in played[0].trajectories()}
    assert {entities.ONLINE, entities.CORRECTED, f"{entities.TRUTH}/camera", entities.SUMMARY} <= paths
    assert not any(path.startswith((entities.CLOUDS, entities.LANDMARKS)) for path in paths)


def test_a_viewer_that_is_asked_to_end_looks_at_no_further_message() -> None:
    """On a crowded machine the messages that wait, and those that come meanwhile, would take half a minute."""
    session, asked = MagicMock(), iter([False, False, True, True])
    waiting = session.subscriber.return_value
    waiting.receive.return_value = Delivery(codec.encode_text(TOPICS.end, BEGIN, ""))
    viewer = Viewer(session, TOPICS, ViewerSettings(), MagicMock())
    viewer.step(lambda: next(asked), repeat=True)
    assert waiting.receive.call_count == 2
    viewer.finish()
    assert waiting.close.call_count == 2


def test_everything_that_is_promised_is_drawn(played: tuple[Scene, list[EntityUpdate]]) -> None:
    scene, drawn = played
    paths = Counter(item.path for item in [*scene.setup(), *drawn])
    for path in (
        entities.WORLD, entities.ONLINE, entities.CORRECTED, f"{entities.TRUTH}/camera", entities.KEYFRAMES,
        entities.LANDMARKS, entities.COVARIANCE, entities.LOOPS_ACCEPTED, entities.LOOPS_REFUSED, entities.CAMERA,
        entities.COLOR, entities.FEATURES, entities.DEPTH, entities.POSITION_ERROR, entities.ROTATION_ERROR,
        entities.INLIERS, entities.TIMES, entities.LOG, entities.SUMMARY,
    ):  # fmt: skip
        assert paths[path] > 0, path
    assert sum(path.startswith(f"{entities.CLOUDS}/") for path in paths) == 20


def test_online_drifts_corrected_and_truth_do_not(played: tuple[Scene, list[EntityUpdate]]) -> None:
    _, drawn = played
    truth = np.array([true_pose(i)[:3, 3] for i in range(300)])

    def distance(path: str) -> float:
        points = np.concatenate([np.array(s) for s in _batch(_last(drawn, path), ["LineStrips3D", "strips"][-1])])
        return float(max(np.min(np.linalg.norm(truth - point, axis=1)) for point in points))

    assert distance(entities.ONLINE) > 0.03
    assert distance(entities.CORRECTED) < 0.01
    assert distance(f"{entities.TRUTH}/camera") < 0.01


@pytest.mark.parametrize("is_on", [True, False])
def test_the_chain_is_a_line_of_its_own_that_can_be_switched_off(is_on: bool) -> None:
    scene, drawn = Scene(TOPICS, ViewerSettings(chain=is_on)), []
    way = [(Stamp(BEGIN + i * PERIOD_NS), true_pose(i)) for i in range(90)]
    for stamp, T in way:
        for topic in (TOPICS.odom, TOPICS.chain):
            message = codec.encode_odometry(topic, stamp, T, 1e-6 * np.eye(6), "odom", "camera")
            drawn += scene.handle(message)
    drawn += scene.handle(codec.encode_path(TOPICS.chain_closed, way[-1][0], way[::10], "odom"))
    drawn += scene.trajectories()
    paths = {item.path for item in drawn}
    assert {entities.CHAIN, entities.CHAIN_CLOSED} <= paths if is_on else not {entities.CHAIN} & paths
    if is_on:
        for path, color in ((entities.CHAIN, palette.CHAIN), (entities.CHAIN_CLOSED, palette.CHAIN_CLOSED)):
            assert _batch(_last(drawn, path), "colors") == [int.from_bytes((*color, 255))]
            points = np.concatenate([np.array(s) for s in _batch(_last(drawn, path), "strips")])
            truth = np.array([T[:3, 3] for _, T in way])
            assert max(np.min(np.linalg.norm(truth - point, axis=1)) for point in points) < 0.02


def test_a_part_that_was_never_joined_is_drawn_apart_with_its_name_until_it_is_joined() -> None:
    scene = _scene()
    drawn = _play(scene, MadeUp(frames=200, images=False, part_from=60, part_until=150))
    part = next(i for i, item in enumerate(drawn) if item.path == f"{entities.UNJOINED}/segment_0" and _named(item))
    item = drawn[part]
    assert item.stamp is not None
    assert 60 <= (item.stamp - BEGIN) / PERIOD_NS <= 120
    assert _batch(item, "labels") == ["segment 0: not joined"]
    assert _batch(item, "colors") == [int.from_bytes((*palette.UNJOINED, 255))]
    first = np.concatenate([np.array(s) for s in _batch(item, "strips")])
    assert np.linalg.norm(first - true_pose(10)[:3, 3], axis=1).min() < 0.05
    own = np.concatenate([np.array(s) for s in _batch(_last(drawn[:part], entities.CORRECTED), "strips")])
    assert np.linalg.norm(own - true_pose(10)[:3, 3], axis=1).min() > 0.3
    assert not _named(_last(drawn, f"{entities.UNJOINED}/segment_0"))  # cleared
    whole = np.concatenate([np.array(s) for s in _batch(_last(drawn, entities.CORRECTED), "strips")])
    assert np.linalg.norm(whole - true_pose(10)[:3, 3], axis=1).min() < 0.05


def _named(item: EntityUpdate) -> bool:
    with suppress(AssertionError):
        return bool(_batch(item, "labels"))
    return False


def test_truth_is_not_drawn_where_there_was_none() -> None:
    scene = _scene()
    heard = [
        message
        for i, frame in enumerate(messages(MadeUp(frames=200, images=False), TOPICS))
        for message in frame
        if not (60 <= i < 120 and message.topic.startswith("truth/"))
    ]
    drawn = [item for message in heard for item in scene.handle(message)]
    points = np.concatenate([np.array(s) for s in _batch(_last(drawn, f"{entities.TRUTH}/camera"), "strips")])
    assert np.linalg.norm(points - true_pose(90)[:3, 3], axis=1).min() > 0.15
    assert np.linalg.norm(points - true_pose(160)[:3, 3], axis=1).min() < 0.1


def test_errors_are_those_of_the_published_pose(played: tuple[Scene, list[EntityUpdate]]) -> None:
    _, drawn = played
    errors = [_batch(item, "scalars") for item in drawn if item.path == entities.POSITION_ERROR]
    assert len(errors) > 150
    assert max(error for error, _ in errors) < 5.0  # millimetres
    bounds = [bound for _, bound in errors]
    assert bounds == sorted(bounds)  # its sigma grows with the frames


def test_errors_are_judged_within_one_segment() -> None:
    """Truth comes later than the poses: those of the segment before wait when the next one begins elsewhere."""
    T_elsewhere = se3.exp(np.array([2.0, 0.0, 0.0, 0.0, 0.5, 0.0]))
    scene, drawn = _scene(), []
    for i in range(180):
        segment, stamp = int(i >= 90), Stamp(BEGIN + i * PERIOD_NS)
        T = T_elsewhere @ true_pose(i) if segment else true_pose(i)
        at = Stamp(stamp - 5 * PERIOD_NS)
        status = codec.Status(stamp, "odometry", 0, "", {"state": "TRACKING", "segment": str(segment)})
        for message in (
            codec.encode_pose(truth("camera"), at, T_WORLD_MAP @ true_pose(i - 5), "world"),
            codec.encode_odometry(TOPICS.odom, stamp, T, 1e-6 * np.eye(6), "odom", "camera"),
            codec.encode_pose(TOPICS.pose, stamp, T, "map"),
            codec.encode_status(TOPICS.status, status),
        ):
            drawn += scene.handle(message)
    errors = {item.stamp: _batch(item, "scalars")[0] for item in drawn if item.path == entities.POSITION_ERROR}
    assert max(errors) > BEGIN + 150 * PERIOD_NS
    assert max(errors.values()) < 5.0  # millimetres


def test_same_messages_same_picture() -> None:
    options = MadeUp(frames=60, camera=SMALL_CAMERA)
    one, two = _play(_scene(), options), _play(_scene(), options)
    assert [(item.path, item.stamp) for item in one] == [(item.path, item.stamp) for item in two]


def test_a_marker_body_on_another_clock_is_brought_onto_the_camera() -> None:
    X = se3.exp(np.array([0.05, -0.04, 0.05, 0.3, 0.3, -0.3]))
    scene = _scene()
    _play(scene, MadeUp(frames=320, body="markers", T_body_camera=X, clock_offset_s=0.037, images=False))
    fit = scene._truth.fit
    assert fit is not None
    assert fit.calibrated is not None
    assert abs(fit.calibrated.offset_s - 0.037) < 0.002
    assert np.linalg.norm(se3.log(se3.inverse(X) @ fit.calibrated.T_body_camera)[:3]) < 0.003
    true = in_map(scene._truth.trajectories["markers"].trajectory(), fit)
    at, valid = true.at(np.array([BEGIN + 200 * PERIOD_NS]), 0.1)
    assert valid[0]
    assert np.linalg.norm(at[0][:3, 3] - true_pose(200)[:3, 3]) < 0.003


def test_a_late_joiner_sees_the_whole_way_from_history_and_path() -> None:
    poses = [(Stamp(BEGIN + i * PERIOD_NS), true_pose(i)) for i in range(0, 500, 3)]
    scene = _scene()
    true = [(stamp, T_WORLD_MAP @ T) for stamp, T in poses]
    scene.history(codec.encode_path("cam0/history/odom", poses[-1][0], poses, "odom"))
    scene.history(codec.encode_path("truth/camera/history", poses[-1][0], true, "world"))
    list(scene.handle(codec.encode_path(TOPICS.path, poses[-1][0], poses[::5], "map")))
    late = [frame for i, frame in enumerate(messages(MadeUp(frames=540, images=False), TOPICS)) if i >= 510]
    drawn = [item for frame in late for message in frame for item in scene.handle(message)]
    for path in (entities.ONLINE, entities.CORRECTED, f"{entities.TRUTH}/camera"):
        points = np.concatenate([np.array(s) for s in _batch(_last(drawn, path), "strips")])
        assert np.linalg.norm(points - true_pose(0)[:3, 3], axis=1).min() < 0.06
        assert len(points) > 60


def test_who_joins_late_is_told_the_time_of_the_whole_way() -> None:
    scene = _scene()
    way = [(Stamp(BEGIN + i * PERIOD_NS), true_pose(i)) for i in range(510)]
    scene.history(codec.encode_path("cam0/history/odom", way[-1][0], way, "odom"))
    late = [frame for i, frame in enumerate(messages(MadeUp(frames=540, images=False), TOPICS)) if i >= 510]
    drawn = [item for frame in late for message in frame for item in scene.handle(message)]
    (text,) = _batch(_last([*drawn, *scene.trajectories()], entities.SUMMARY), "text")
    assert f" m in {539 * PERIOD_NS * 1e-9:.1f} s" in text


def test_the_newest_piece_of_a_line_does_not_lead_over_a_loss() -> None:
    scene, drawn = _scene(), []
    for i in [*range(90), *range(105, 110)]:
        stamp, T = Stamp(BEGIN + i * PERIOD_NS), true_pose(i)
        drawn += scene.handle(codec.encode_odometry(TOPICS.odom, stamp, T, 1e-6 * np.eye(6), "odom", "camera"))
        drawn += scene.handle(codec.encode_pose(TOPICS.pose, stamp, T, "map"))
    for line in (entities.ONLINE, entities.CORRECTED):
        (tail,) = _batch(_last(drawn, f"{line}/tail"), "strips")
        assert np.linalg.norm(np.diff(np.array(tail), axis=0), axis=1).max() < 0.05, line


def test_memory_is_bounded_and_old_clouds_are_cleared() -> None:
    scene = _scene(path_poses=64, cloud_keyframes=8, loops=10)
    drawn = _play(scene, MadeUp(frames=90, keyframe_every=2, camera=SMALL_CAMERA))
    assert len(scene._map.online) <= 65
    assert len(scene._map.clouds) <= 8
    assert len(scene._map._loops) <= 10
    cleared = {item.path for item in drawn if "Clear" in type(item.parts[0]).__name__}
    shown = {item.path for item in drawn if "Points3D" in type(item.parts[0]).__name__ and entities.CLOUDS in item.path}
    assert len(shown - cleared) <= 8


@given(
    keyframes=st.integers(1, 200),
    joined=st.integers(0, 200),
    limit=st.sampled_from([2, 7, 8, 160]),
)
def test_who_joins_late_keeps_the_same_key_frames_as_who_was_there(keyframes: int, joined: int, limit: int) -> None:
    maker: KeyframeClouds[int] = KeyframeClouds(limit)
    early, late = KeyframeClouds[int](limit), KeyframeClouds[int](limit)
    for i in range(keyframes):
        if i == joined:
            for stamp in maker:
                late.keep(stamp, maker[stamp])
        if maker.takes_next():
            for kept in (maker, early, *([late] if i >= joined else [])):
                kept.keep(Stamp(i), i)
        assert len(maker) <= limit
        assert list(early) == list(maker)
        assert i < joined or list(late) == list(maker)
    steps = np.diff(list(maker))
    assert len(set(steps.tolist())) <= 1  # evenly thinned
    assert len(maker) == keyframes or len(maker) > (limit - 1) // 2


def test_the_cloud_of_a_key_frame_is_its_image_in_space() -> None:
    camera = Camera(320, 240, 260.0, 260.0, 159.5, 119.5)
    depth = np.full((240, 320), 2000, np.uint16)
    depth[:, 160:] = 0
    color = np.zeros((60, 80, 3), np.uint8)
    color[:30] = 255, 0, 0
    color[30:] = 0, 0, 255
    cloud = back_project(camera, color, depth, 1000)
    assert 400 < len(cloud.points) <= 500
    assert np.allclose(cloud.points[:, 2], 2.0)
    assert (cloud.points[:, 0] < 0.01).all()
    above = cloud.points[:, 1] < 0
    assert (cloud.colors[above] == (255, 0, 0)).all()
    assert (cloud.colors[~above] == (0, 0, 255)).all()


@pytest.mark.parametrize("path_first", [True, False])
def test_a_cloud_is_shown_once_its_place_is_known(path_first: bool) -> None:
    scene, stamp = _scene(), BEGIN
    path = codec.encode_path(TOPICS.path, stamp, [(stamp, true_pose(7))], "map")
    points, colors = np.ones((4, 3), np.float32), np.full((4, 3), 9, np.uint8)
    cloud = codec.encode_cloud(TOPICS.keyframes, stamp, points, colors, "camera")
    first, second = (path, cloud) if path_first else (cloud, path)
    entity = f"{entities.CLOUDS}/{stamp}"
    assert not any(item.path == entity for item in scene.handle(first))
    shown = [item for item in scene.handle(second) if item.path == entity]
    assert [type(item.parts[0]).__name__ for item in shown] == ["Points3D", "Transform3D"]
    assert not any(item.path == entity for item in [*scene.handle(path), *scene.handle(cloud)])


def test_a_run_whose_stamps_go_back_is_shown_on_a_timeline_of_its_own() -> None:
    """Rerun shows the end of a timeline: on that of the run before it would stand still there."""
    session, recording, small, images = (MagicMock() for _ in range(4))
    session.subscriber.side_effect = [small, images]
    images.receive.return_value = None
    frames = [
        [message for message in frame if message.topic == TOPICS.odom]
        for frame in messages(MadeUp(frames=180, camera=SMALL_CAMERA, images=False), TOPICS)
    ]
    deliveries = [Delivery(message) for frame in [*frames, *frames[:2]] for message in frame]
    small.receive.side_effect = [*deliveries, None]
    viewer = Viewer(session, TOPICS, ViewerSettings(), recording)
    viewer.step(lambda: False, repeat=False)
    named = [call.args[0] for call in recording.set_time.call_args_list]
    assert list(dict.fromkeys(named)) == ["capture", "capture 2"]
    assert named.index("capture 2") >= 180
    (sent,) = recording.send_blueprint.call_args_list
    assert sent.args[0].time_panel.timeline == "capture 2"


def test_what_is_logged_on_one_timeline_is_on_no_other(tmp_path: Path) -> None:
    recording, file = rr.RecordingStream("test"), tmp_path / "seen.rrd"
    recording.set_sinks(rr.FileSink(file))
    for timeline, stamp in (("capture", 9), ("capture 2", 5)):
        log_to(recording, update(entities.LOG, Stamp(stamp), rr.TextLog(timeline)), timeline)
    recording.flush()
    recording.disconnect()
    names = [
        {name for name in chunk.to_record_batch().schema.names if name.startswith("capture")}
        for chunk in RrdReader(file).stream()
        if chunk.entity_path == f"/{entities.LOG}"
    ]
    assert sorted(names, key=sorted) == [{"capture"}, {"capture 2"}]


def test_going_back_in_time_begins_a_new_run() -> None:
    scene = _scene()
    _play(scene, MadeUp(frames=180, images=False))
    drawn = _play(scene, MadeUp(frames=10, images=False))
    assert any("new run" in str(_batch(item, "text")) for item in drawn if item.path == entities.LOG)
    assert len(scene._map.online) == 10


@given(
    data=st.binary(max_size=200),
    which=st.sampled_from(["odom", "color", "status", "path", "features", "moving", "keyframes", "camera_info"]),
)
def test_malformed_messages_raise_only_wire_errors_and_spoil_nothing(data: bytes, which: str) -> None:
    topic, kind = {
        "odom": (TOPICS.odom, "nav_msgs/msg/Odometry"),
        "color": (TOPICS.color, "sensor_msgs/msg/Image"),
        "status": (TOPICS.status, "diagnostic_msgs/msg/DiagnosticArray"),
        "path": (TOPICS.path, "nav_msgs/msg/Path"),
        "features": (TOPICS.features, "sensor_msgs/msg/PointCloud2"),
        "moving": (TOPICS.moving, "sensor_msgs/msg/PointCloud2"),
        "keyframes": (TOPICS.keyframes, "sensor_msgs/msg/PointCloud2"),
        "camera_info": (TOPICS.camera_info, "sensor_msgs/msg/CameraInfo"),
    }[which]
    scene = _scene()
    with suppress(WireError):
        list(scene.handle(Message(topic, kind, Stamp(0), b"\0\1\0\0" + data)))
    assert _play(scene, MadeUp(frames=2, images=False))


def test_what_moves_is_hatched_in_the_image_until_nothing_does() -> None:
    scene = _scene()
    mask = np.zeros((15, 20), bool)
    mask[3:5, 7] = True
    for moves, squares in ((mask, 2), (np.zeros_like(mask), 0)):
        message = moving_message(TOPICS, Stamp(1), MovingCells(moves, float(moves.mean()), (480, 640)))
        (hatching,) = scene.handle(message)
        strokes = _batch(hatching, "strips")
        assert len(strokes) == 3 * squares
        if squares:
            ends = np.array(strokes)
            assert ends.min(axis=(0, 1)).tolist() == [7 * 32, 3 * 32]
            assert ends.max(axis=(0, 1)).tolist() == [8 * 32, 5 * 32]


def test_residual_colours_tell_small_large_and_unused_apart() -> None:
    colors = palette.residual_colors(np.array([0.0, 1.5, 9.0, np.nan]))
    assert len(np.unique(colors, axis=0)) == 4
    assert (colors[2] == palette.residual_colors(np.array([3.0]))[0]).all()
    assert colors[3, 3] < 255


def test_a_loop_that_comes_by_the_history_and_by_itself_is_one() -> None:
    scene = _scene()
    message = codec.encode_loop(TOPICS.loops, codec.Loop(Stamp(5), Stamp(1), 40, True, "40 landmarks found again"))
    said = [list(scene.handle(message)) for _ in range(2)]
    assert said[0]
    assert not said[1]
    assert len(scene._map._loops) == 1
