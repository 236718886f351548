"""The closed chain: closures against key frames of long ago, checked and met together with the links."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from painted_room import SMALL, PaintedRoom, stroll

from odom.backend import ClosedChain, Odometry, OdometrySettings
from odom.backend.chain.closed_chain import _closed_poses, _pieces
from odom.backend.chain.closures import ChainNode, Closures
from odom.backend.chain.tuning import TUNING as CHAIN
from odom.backend.map.pose_graph import Edge
from odom.frame import Stamp
from odom.geometry import se3


def walked(nodes=24, drift=0.0):
    """A chain of nodes on a closed circle, its motions off by `drift` each; the true poses."""
    turn = se3.exp(np.array([2 * np.pi / nodes, 0.0, 0.0, 0.0, 0.0, 2 * np.pi / nodes]))
    true, chained = [np.eye(4)], [np.eye(4)]
    off = se3.exp(drift * np.array([0.01, 0.01, 0.0, 0.0, 0.0, 0.01]))
    for _ in range(nodes - 1):
        true.append(true[-1] @ turn)
        chained.append(chained[-1] @ turn @ off)
    covariance, total = np.diag([1e-4] * 6), np.zeros((6, 6))
    closures = Closures()
    for k in range(nodes):
        total = total if k == 0 else se3.compose_covariance(total, se3.inverse(chained[k - 1]) @ chained[k], covariance)
        closures.add(ChainNode(k, Stamp(k * 10**9), None, chained[k], total))
    return closures, true, chained, covariance


def test_the_covariance_between_two_nodes_is_that_of_the_links_between_them():
    closures, _, chained, covariance = walked(drift=1.0)
    expected = np.zeros((6, 6))
    for k in range(8, 20):
        expected = se3.compose_covariance(expected, se3.inverse(chained[k]) @ chained[k + 1], covariance)
    edge = closures.nodes[8].edge_to(closures.nodes[20])
    np.testing.assert_allclose(edge.covariance, expected, atol=1e-12)
    np.testing.assert_allclose(chained[8] @ edge.T_a_b, chained[20], atol=1e-12)


def test_nodes_stay_within_their_bound_and_no_closure_outlives_its_ends():
    closures = Closures()
    for k in range(2 * CHAIN.closed_most_nodes + 10):
        node = ChainNode(k, Stamp(k * 10**9), None, np.eye(4), k * np.eye(6))
        closures.add(node)
        if k:
            closures.edges.append(Edge(max(0, k - 5), node.number, np.eye(4), np.eye(6), is_loop=True))
    numbers = [node.number for node in closures.nodes]
    assert len(numbers) <= CHAIN.closed_most_nodes
    assert numbers[0] == 0
    assert numbers[-1] == 2 * CHAIN.closed_most_nodes + 9
    assert all(edge.a in numbers and edge.b in numbers for edge in closures.edges)


def test_between_two_nodes_the_correction_is_shared_by_time():
    stamps = np.array([10, 20], dtype=np.int64)
    moved = se3.exp(np.array([0.2, 0.0, 0.0, 0.0, 0.0, 0.1]))
    closed = ClosedChain(
        stamps, np.zeros_like(stamps), np.array([np.eye(4), moved]), np.array([np.eye(4), moved]), 1, 0, 1, None
    )
    np.testing.assert_allclose(closed.moved(Stamp(5), np.eye(4)), np.eye(4))
    np.testing.assert_allclose(closed.moved(Stamp(20), np.eye(4)), moved)
    np.testing.assert_allclose(closed.moved(Stamp(99), np.eye(4)), moved)
    half = closed.moved(Stamp(15), np.eye(4))
    np.testing.assert_allclose(half @ half, moved, atol=1e-12)


def test_where_stamps_come_again_each_pose_is_moved_by_the_nodes_of_its_own_time():
    stamps, steps_back = np.array([10, 20, 10, 20], dtype=np.int64), np.array([0, 0, 1, 1], dtype=np.int64)
    moved = np.array([se3.exp(k * np.full(6, 0.1)) for k in (0, 2, 6, 8)])
    closed = ClosedChain(stamps, steps_back, moved, moved, 1, 0, 1, None)
    np.testing.assert_allclose(closed.moved(Stamp(15), np.eye(4), 1), se3.exp(np.full(6, 0.1)), atol=1e-12)
    np.testing.assert_allclose(closed.moved(Stamp(15), np.eye(4)), se3.exp(np.full(6, 0.7)), atol=1e-12)
    np.testing.assert_allclose(closed.moved(Stamp(30), np.eye(4), 1), moved[1])
    np.testing.assert_allclose(closed.moved(Stamp(5), np.eye(4)), moved[2])
    np.testing.assert_allclose(closed.moved(Stamp(15), np.eye(4), 2), moved[0])  # before what is known


def test_the_first_frame_after_a_step_back_of_the_stamps_is_a_node():
    closures = Closures()
    closures.add(ChainNode(0, Stamp(10**10), None, np.eye(4), np.zeros((6, 6))))
    assert not closures.are_due(Stamp(10**10 + 10**8), 0)
    assert closures.are_due(Stamp(10**10 + 10**8), 1)
    assert closures.are_due(Stamp(10**9), 1)


@pytest.fixture(scope="module")
def there_and_back():
    """Four seconds of the painted room's walk, and the way back."""
    room = PaintedRoom()
    steps = [*range(60), *range(58, -1, -1)]
    return [room.frame(SMALL, number, stroll(k / 30.0)) for number, k in enumerate(steps)]


AT_ONCE = {
    f"{name}_prior_{kind}": value
    for name in ("readout", "depth_lag", "depth_readout")
    for kind, value in (("s", 0.0), ("sigma_s", 1e-3))
}
KNOWN = OdometrySettings(**AT_ONCE)
"""What is true of painted images: all rows and depth are taken at once."""


def closed_run(frames, change=None, settings=None):
    """The odometry after a walk, and the chain's poses; `change` alters the odometry on the way, frame by frame."""
    odometry, poses = Odometry(SMALL, settings), {}
    for frame in frames:
        estimate = odometry.process(frame)
        if change is not None:
            change(odometry, frame)
        if estimate.chain is not None:
            poses[estimate.stamp] = estimate.chain.T_chain_camera
    odometry.finish()
    return odometry, poses


def test_a_walk_there_and_back_closes_and_passes_its_test(there_and_back):
    odometry, poses = closed_run(there_and_back, settings=KNOWN)
    closed, ends = odometry.closed_chain(), [there_and_back[k].stamp for k in (0, -1)]
    assert closed.closures > 5
    assert closed.closing.closed_sigma < 4.0
    assert closed.closing.chain_sigma < 4.0
    first, last = (closed.moved(stamp, poses[stamp]) for stamp in ends)
    away = [np.linalg.norm((se3.inverse(a) @ b)[:3, 3]) for a, b in ((first, last), (poses[ends[0]], poses[ends[1]]))]
    assert away[0] < 0.8 * away[1] < 0.01  # the walk ends where it began


def test_what_was_measured_before_the_timing_was_known_closes_by_the_timing_that_was_found(there_and_back):
    """A first frame that was taken to be read in 24 ms, as a Kinect's is, was bent by .2 deg."""
    closing = closed_run(there_and_back)[0].closed_chain().closing
    assert closing.closed_sigma < 4.0
    off = np.abs(se3.log(closing.direct.T_earlier_current))  # the walk ends where it began
    assert off[:3].max() < 0.001
    assert off[3:].max() < 0.0005


def test_a_closure_that_contradicts_the_chain_is_refused_and_never_enters(there_and_back):
    """The key frames' measurements are turned by ten degrees behind the chain's back: closures with them are wrong."""
    turn = se3.exp(np.array([0.0, 0.0, 0.0, 0.0, np.radians(10.0), 0.0]))
    turned = set()

    def spoil(odometry, frame):
        if frame.sequence == 59:
            for keyframe in odometry.map.keyframes[:-1]:  # the newest one is measured once more
                x, y, w = keyframe.measurements.values.T
                points = se3.apply(turn, np.column_stack([x, y, np.ones_like(x)]) / w[:, None])
                values = np.column_stack([points[:, :2], np.ones(len(points))]) / points[:, 2:]
                keyframe.measurements = replace(keyframe.measurements, values=values)
                turned.add(keyframe.number)

    odometry, poses = closed_run(there_and_back, spoil)
    closures = odometry._stages.chain.closures
    later = {node.number for node in closures.nodes if node.stamp > there_and_back[59].stamp}
    wrong = {node.number for node in closures.nodes if node.keyframe in turned}
    assert closures.refused > 5
    assert not [edge for edge in closures.edges if edge.a in wrong and edge.b in later]
    closed = odometry.closed_chain()
    moved = [se3.log(se3.inverse(T) @ closed.moved(stamp, T)) for stamp, T in poses.items()]
    assert np.abs(moved).max() < 0.02


def test_over_a_hole_that_nothing_joins_the_closed_chain_stands_still(there_and_back):
    """Two other rooms behind the first, which the map cannot join: each is closed by itself."""
    frames, rooms = there_and_back[:90], [PaintedRoom(seed=5), PaintedRoom(seed=6)]
    for room in rooms:
        frames = frames + [room.frame(SMALL, k, stroll(k / 30.0)) for k in range(len(frames), len(frames) + 36)]
    odometry, poses = closed_run(frames)
    closed = odometry.closed_chain()
    assert closed.pieces == 3
    assert closed.closing is None
    assert closed.closures > 0
    moved = {stamp: closed.moved(stamp, T) for stamp, T in poses.items()}
    steps = list(pairwise(sorted(poses)))
    chained, met = ([se3.log(se3.inverse(T[a]) @ T[b]) for a, b in steps] for T in (poses, moved))
    np.testing.assert_allclose(met, chained, atol=0.01)  # no room is bent by another one, and no hole is leapt over


def test_a_hole_that_closures_join_is_theirs_to_bridge():
    """Two halves of a circle with a hole between, where the chain stands still: closures say how they lie."""
    closures, true = walked(nodes=12)[:2]
    turned = se3.inverse(true[6] @ se3.inverse(true[5]))  # the second half begins where the first one ended
    nodes = [replace(n, T_chain_camera=turned @ true[k], part=1) if k >= 6 else n for k, n in enumerate(closures.nodes)]
    met = [Edge(a, b, se3.inverse(true[a]) @ true[b], 1e-4 * np.eye(6), is_loop=True) for a, b in ((2, 7), (1, 9))]
    assert _pieces(nodes, met) == {0: 0, 1: 0}
    assert _pieces(nodes, []) == {0: 0, 1: 1}
    solved, _ = _closed_poses(nodes, met, _pieces(nodes, met))
    np.testing.assert_allclose([solved[k] for k in range(12)], true, atol=1e-3)


def test_pieces_are_closed_by_themselves_however_sure_their_links_are():
    """Two circles with a hole between them: the second one is closed, and begins where the first one now ends."""
    closures, _, chained, covariance = walked(drift=0.1)
    first = [replace(node, summed_covariance=1e-8 * node.summed_covariance) for node in closures.nodes]
    second = [replace(node, number=node.number + len(first), part=1) for node in first]
    nodes, piece = [*first, *second], {0: 0, 1: 1}
    last = len(nodes) - 1
    ends = se3.inverse(chained[0]) @ chained[-1] @ se3.exp(np.array([0.01, 0.0, 0.0, 0.0, 0.0, 0.0]))
    loops = [Edge(a, b, ends, 1e-12 * covariance) for a, b in ((0, len(first) - 1), (len(first), last))]
    T, sure = _closed_poses(nodes, loops, piece)
    for a, b in ((0, len(first) - 1), (len(first), last)):
        np.testing.assert_allclose(se3.inverse(T[a]) @ T[b], ends, atol=1e-3)
    over = first[-1].edge_to(second[0]).T_a_b
    np.testing.assert_allclose(se3.inverse(T[len(first) - 1]) @ T[len(first)], over, atol=1e-9)
    assert np.linalg.eigvalsh(sure).min() > 0.0
