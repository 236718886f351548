"""The eye of the map: of a desk it sees the desk, of a hall the hall, and the way in both."""

from unittest.mock import MagicMock

import numpy as np
import pytest
from made_up_device import BEGIN, CAMERA, MadeUp, messages, true_pose

from odom.frame import Stamp
from odom.geometry.arrays import Array
from odom.viewer import ViewerSettings, entities
from odom.viewer.ellipsoids import ellipsoids, standing_apart
from odom.viewer.framing import Framing
from odom.viewer.scene import Scene
from odom.viewer.viewer_process import Viewer
from odom.wire import Topics, codec
from odom.wire.codec import StampedPose
from odom.wire.delivery import Delivery

TOPICS = Topics("cam0")
DESK = np.array([[-0.1, 0.0, 0.0], [0.1, 0.05, 0.1]])
HALL = np.array([[-6.0, 0.0, 0.0], [6.0, 0.5, 8.0]])
_VIEW = 0.52
"""Tangent of half the angle that the eye sees from top to bottom."""


def _angles(point: Array, eye: Array, look_at: Array) -> float:
    """Tangent between a point and the middle of the view, as seen from the eye."""
    forward = (look_at - eye) / np.linalg.norm(look_at - eye)
    along = float((point - eye) @ forward)
    return float(np.linalg.norm(point - eye - along * forward)) / along if along > 0 else np.inf


@pytest.mark.parametrize(("depth_m", "way"), [(1.1, DESK), (3.0, DESK), (3.0, HALL), (0.8, HALL)])
def test_the_way_is_in_view_and_not_a_dot(depth_m: float, way: Array) -> None:
    frame = Framing().fit(depth_m, way)
    assert frame is not None
    assert all(_angles(point, frame.eye, frame.look_at) < _VIEW for point in way)
    assert np.linalg.norm(frame.eye - frame.look_at) < max(3.0 * depth_m, 1.5 * np.linalg.norm(way[1] - way[0]))
    assert frame.eye[1] < way[:, 1].min()  # above
    assert frame.eye[2] < way[:, 2].mean()  # behind


def test_what_the_camera_sees_at_a_desk_is_in_view() -> None:
    frame = Framing().fit(1.1, DESK)
    assert frame is not None
    assert _angles(np.array([0.0, 0.0, 1.1]), frame.eye, frame.look_at) < 2 * _VIEW
    assert frame.frustum_m < 0.1 < Framing().fit(3.0, HALL).frustum_m  # type: ignore[union-attr]


def test_the_eye_stays_until_the_way_leaves_the_view_and_the_way_is_always_seen() -> None:
    framing, frame = Framing(), None
    assert framing.fit(None, HALL * 0.02) is None  # no depth yet
    turns = np.linspace(0.0, 2.0 * np.pi, 500)
    lap = np.stack([5.0 * np.sin(turns), 0.0 * turns, 5.0 - 5.0 * np.cos(turns)], axis=-1)
    taken = 0
    for walked in range(1, len(lap) + 1):
        step = framing.fit(2.0, lap[:walked])
        taken, frame = taken + (step is not None), step or frame
        assert frame is not None
        assert all(_angles(point, frame.eye, frame.look_at) < _VIEW for point in lap[:walked:7])
    assert 2 <= taken <= 7
    assert framing.fit(9.0, lap) is None  # a look at a far wall does not move the eye


def test_ellipsoids_stand_apart_and_the_newest_is_drawn() -> None:
    centres = np.linspace(0, 1, 11)[:, None] * np.array([1.0, 0.0, 0.0])
    assert standing_apart(centres, np.full(11, 0.25)) == [1, 4, 7, 10]
    assert standing_apart(centres, np.full(11, 5.0)) == [10]
    assert standing_apart(centres, np.zeros(11)) == list(range(11))
    poses = [StampedPose(Stamp(i), "map", "camera", true_pose(i)) for i in range(50)]
    (drawn,) = ellipsoids(Stamp(0), poses, [np.eye(6) * 0.02**2] * 50)
    centres = np.array(drawn.parts[0].as_component_batches()[0].as_arrow_array().to_pylist()).reshape(-1, 3)
    assert 2 < len(centres) < 15
    assert list(ellipsoids(Stamp(0), [], [])) == []


def test_the_viewer_frames_what_it_shows_once_it_knows_it() -> None:
    session, recording = MagicMock(), MagicMock()
    heard = [message for frame in messages(MadeUp(frames=40), TOPICS) for message in frame]
    # depth before the first pose, as it comes on the wire
    depth = codec.encode_depth(TOPICS.depth, BEGIN, np.full((CAMERA.height, CAMERA.width), 1500, np.uint16))
    waiting = iter([depth, *heard])
    session.subscriber.return_value.receive.side_effect = lambda _: _delivered(next(waiting, None))
    viewer = Viewer(session, TOPICS, ViewerSettings(image_rate_hz=1e3), recording)
    for _ in range(len(heard)):
        viewer.step(lambda: False, repeat=False)
    assert recording.send_blueprint.call_count == 1
    sizes = {str(call) for call in recording.log.call_args_list if call.args[0] == entities.COLOR}
    assert len(sizes) >= 2  # the pinhole, and the pinhole in proportion


def _delivered(message: object) -> Delivery | None:
    return None if message is None else Delivery(message)  # type: ignore[arg-type]


def test_a_new_frame_is_told_once() -> None:
    scene = Scene(TOPICS, ViewerSettings())
    for frame in messages(MadeUp(frames=60), TOPICS):
        for message in frame:
            list(scene.handle(message))
    assert scene.new_frame() is not None
    assert scene.new_frame() is None
