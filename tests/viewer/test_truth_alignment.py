"""Truth in the live map: a camera that only turns is compared with it as fairly as one that walks."""

import numpy as np
from made_up_device import BEGIN, PERIOD_NS, T_WORLD_MAP, MadeUp, messages

from odom.evaluation import Trajectory
from odom.evaluation.mocap_calibration import Calibration
from odom.frame import Stamp
from odom.geometry import se3
from odom.geometry.arrays import Array
from odom.viewer import ViewerSettings, entities
from odom.viewer.claimed_covariances import ClaimedCovariances
from odom.viewer.scene import Scene
from odom.viewer.truth_alignment import Comparison, align_truth
from odom.wire import Topics

SIGMA = np.array([0.004] * 3 + [0.008] * 3)


def _turning(count: int, rng: np.random.Generator, metres: float = 0.005) -> tuple[Trajectory, Trajectory, Array]:
    """A camera that looks about from where it stands: its estimate, its truth at three times the rate, covariances."""
    t = np.arange(3 * count) / 90.0
    xi = np.column_stack([metres * np.sin(t * k) for k in (1.0, 1.3, 1.7)] + [0.4 * np.sin(t * k) for k in (2, 3, 1)])
    T = np.array([se3.exp(x) for x in xi])
    stamps = BEGIN + np.arange(3 * count) * np.int64(PERIOD_NS // 3)
    e = rng.normal(0, 1, (count, 6)) * SIGMA
    estimate = np.array([pose @ se3.exp(x) for pose, x in zip(T[::3], e, strict=True)])
    covariances = np.tile(np.diag(SIGMA**2), (count, 1, 1))
    return Trajectory(stamps[::3], estimate), Trajectory(stamps, T_WORLD_MAP @ T), covariances


def _claims(estimate: Trajectory, covariances: Array) -> ClaimedCovariances:
    claimed = ClaimedCovariances()
    for stamp, covariance in zip(estimate.stamps, covariances, strict=True):
        claimed.add(Stamp(int(stamp)), covariance)
    return claimed


def test_errors_of_a_camera_that_only_turns_are_within_their_bounds() -> None:
    """By positions alone the two worlds would be turned against each other by tens of degrees."""
    estimate, truth, covariances = _turning(240, np.random.default_rng(0))
    fit = align_truth(estimate, _claims(estimate, covariances), truth, None, markers=False)
    assert fit is not None
    comparison = Comparison()
    for stamp, T in zip(truth.stamps, truth.T_world_body, strict=True):
        comparison.add_truth(Stamp(int(stamp)), T)
    for stamp, T, covariance in zip(estimate.stamps, estimate.T_world_body, covariances, strict=True):
        comparison.add(Stamp(int(stamp)), T, covariance)
    errors = list(comparison.errors(fit))
    assert len(errors) == 240
    assert np.mean([e.rotation_deg for e in errors]) < 1.2
    assert np.mean([e.rotation_deg < e.bound_deg for e in errors]) > 0.98
    assert np.mean([e.position_m < e.bound_m for e in errors]) > 0.98
    assert max(e.bound_deg for e in errors) < 4.0


def test_the_bounds_are_wider_than_the_claim_by_what_the_alignment_does_not_know() -> None:
    estimate, truth, covariances = _turning(60, np.random.default_rng(1))
    fit = align_truth(estimate, _claims(estimate, covariances), truth, None, markers=False)
    assert fit is not None
    T, claimed = estimate.T_world_body[30], covariances[30]
    wider = 3.0 * np.sqrt(np.linalg.eigvalsh((claimed + fit.alignment.at(T) + fit.truth_covariance)[:3, :3])[-1])
    assert np.isclose(fit.bounds(T, claimed)[0], wider)
    assert fit.bounds(T, claimed)[0] > 3.0 * SIGMA[0]
    assert np.isnan(fit.bounds(T, None)).all()


def test_truth_is_not_aligned_before_enough_is_known() -> None:
    rng = np.random.default_rng(2)
    estimate, truth, covariances = _turning(60, rng)
    assert align_truth(estimate.take(np.arange(5)), ClaimedCovariances(), truth, None, markers=False) is None
    unsure = 400.0 * covariances  # 9 deg
    assert align_truth(estimate, _claims(estimate, unsure), truth, None, markers=False) is None
    # of markers on a camera that only turns, positions are all there is
    assert align_truth(estimate, _claims(estimate, covariances), truth, None, markers=True) is None


def test_a_hand_eye_that_is_hardly_known_widens_the_bounds() -> None:
    estimate, truth, covariances = _turning(60, np.random.default_rng(3))
    bounds = []
    for sigma in (0.0, 0.03):
        calibrated = Calibration(0.0, 0.0, np.eye(4), np.full(6, sigma), np.eye(4), 1.0, ())
        fit = align_truth(estimate, _claims(estimate, covariances), truth, calibrated, markers=True)
        assert fit is not None
        bounds.append(fit.bounds(estimate.T_world_body[30], covariances[30]))
    assert bounds[1][0] > np.hypot(bounds[0][0], 0.09)
    assert bounds[1][1] > np.hypot(bounds[0][1], np.degrees(0.09))


def test_where_no_covariances_are_known_they_are_learnt() -> None:
    estimate, truth, _ = _turning(60, np.random.default_rng(4))
    fit = align_truth(estimate, ClaimedCovariances(), truth, None, markers=False)
    assert fit is not None
    off = se3.log(fit.T_map_truth @ T_WORLD_MAP)
    assert np.degrees(np.linalg.norm(off[3:])) < 0.5


def test_the_summary_says_that_truth_is_not_aligned_yet() -> None:
    topics = Topics("cam0")
    scene = Scene(topics, ViewerSettings())
    played = messages(MadeUp(frames=100, images=False), topics)
    texts = [
        str(part.as_component_batches()[0].as_arrow_array().to_pylist())
        for frame in played
        for message in frame
        for item in scene.handle(message)
        if item.path == entities.SUMMARY
        for part in item.parts
    ]
    assert "not aligned yet" in texts[0]
    assert "ATE so far" in texts[-1]


def test_covariances_of_kept_poses_outlive_the_newest_ones() -> None:
    claimed = ClaimedCovariances()
    stamps = np.arange(3000, dtype=np.int64)
    for stamp in stamps:
        claimed.add(Stamp(int(stamp)), np.eye(6))
        if stamp % 500 == 0:
            claimed.keep(stamps[: stamp + 1 : 100])
    _, known = claimed.of(stamps)
    assert known[2100:].all()  # recent
    assert known[:2100].sum() == 21  # kept
    claimed.add(Stamp(3000), np.zeros((6, 6)))
    assert not claimed.of(np.array([3000]))[1].any()  # the first pose of a segment
    assert claimed.get(Stamp(3000)) is not None
