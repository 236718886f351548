"""What a frame that landmarks placed adds to the chain and to the map; it then is the newest with a pose."""

from dataclasses import replace

from odom.backend.chain.chain_frame import ChainFrame
from odom.backend.chain.named_features import NamedFeatures
from odom.backend.estimate import Estimate, State
from odom.backend.odometry.frame_stages import FrameStages
from odom.backend.odometry.judged_frame import PlacedFrame
from odom.backend.odometry.tuning import TUNING
from odom.backend.stopwatch import Stopwatch
from odom.backend.tracking.posed_frame import PosedFrame


def extend_chain_and_map(stages: FrameStages, placed: PlacedFrame, estimate: Estimate, watch: Stopwatch) -> Estimate:
    """Extend chain and map by a placed frame; return its `estimate` with what they say of it."""
    watch.lap("publish")
    tracked, chain, map_, sensor = placed.judged.tracked, stages.chain, stages.map, stages.sensor
    features = NamedFeatures.of(tracked, map_.landmarks.identity[tracked.rows])
    T_hint = None if stages.last is None else stages.last.motion_to(tracked, map_)
    frame = ChainFrame(placed.judged.view, features, tracked.twist, placed.published)
    chained = chain.extend(frame, T_hint, sensor)
    watch.lap("chain")
    is_keyframe = _extend_map(stages, placed)
    watch.lap("map")
    chain.close(map_, is_keyframe, tracked.reference, sensor)
    watch.lap("chain")
    return replace(estimate, is_keyframe=is_keyframe, pairwise=chain.link, chain=chained, moving=stages.moving.cells)


def _extend_map(stages: FrameStages, placed: PlacedFrame) -> bool:
    """Add to the map what it needs of a placed frame, and make that the newest; return whether it is a key frame."""
    judged, mapper, log, sensor = placed.judged, stages.mapper, stages.published.log, stages.sensor
    view, tracked, in_doubt = judged.view, judged.tracked, stages.moving.is_doubtful
    if mapper.intermediate.wants(log.count - 1, sensor.clock.period_s):
        mapper.keep(log.count - 1, tracked, sensor)
    mapper.start_background(log, sensor, stages.closer.is_idle)
    reference, rows, uv = tracked.reference, tracked.inlier_landmarks.rows, tracked.inlier_landmarks.uv
    if judged.state is State.RECOVERED:
        mapper.inserter.compare_with(reference)
    # A recovered frame is no key frame: its motion, which bends what it measured, is not known. The next may be.
    is_motion_unknown = judged.state is State.RECOVERED and sensor.clock.period_s < TUNING.longest_gap_s
    has_depth = stages.last_depth.placing_stamp == view.steady_stamp
    is_keyframe = has_depth and not is_motion_unknown and mapper.inserter.is_due(view, tracked, in_doubt)
    if is_keyframe:
        keyframe = mapper.inserter.insert(view, tracked, judged.twist, judged.covariance, sensor, log.count, in_doubt)
        keyframe.T_middle_stamp = placed.published.T_middle_stamp
        reference, rows, uv = keyframe.number, keyframe.rows, keyframe.uv
    begun = None if stages.last is None else stages.last.begun_stamp
    stages.last = PosedFrame(view, tracked, tracked.T_camera_map, judged.twist, reference, rows, uv, begun)
    mapper.inserter.recent.remember(stages.last)
    return is_keyframe
