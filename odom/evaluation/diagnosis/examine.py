"""Runs all checks over a part of a source, in the order in which faults should be repaired."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from odom.errors import InputError
from odom.evaluation.diagnosis.depth import judge_noise, judge_valid
from odom.evaluation.diagnosis.depth_unit import judge_unit
from odom.evaluation.diagnosis.edges import EdgeShift, edge_shift
from odom.evaluation.diagnosis.finding import Finding, Verdict
from odom.evaluation.diagnosis.fixed_parts import judge_fixed_parts
from odom.evaluation.diagnosis.form import judge_change, judge_lens, judge_refused, judge_sizes
from odom.evaluation.diagnosis.image import judge_blur, judge_exposure
from odom.evaluation.diagnosis.intrinsics import judge_intrinsics
from odom.evaluation.diagnosis.motion import PairMotion, fit_focal, pair_motion
from odom.evaluation.diagnosis.orientation import judge_orientation
from odom.evaluation.diagnosis.recording import Recording
from odom.evaluation.diagnosis.scale import BodyTruth, body_truth, chain, fit_scale, judge_scale
from odom.evaluation.diagnosis.stamps import judge_pairs, judge_rhythm
from odom.evaluation.diagnosis.tracks import Tracks, follow
from odom.evaluation.judgement import judge as judged_by
from odom.evaluation.mocap_calibration import CalibrationOptions
from odom.evaluation.pose_conventions import convention_notes
from odom.evaluation.report import EvaluationOptions, Report
from odom.evaluation.run_report import CAMERA
from odom.evaluation.times import Stamps
from odom.evaluation.trajectory import Trajectory
from odom.frame import Camera, RgbdFrame
from odom.geometry.arrays import Array

_IMAGES = 30
"""Frames that are looked at for exposure, sharpness and depth: more only cost time."""
_EDGE_FRAMES = 36
"""Frames whose edges are compared: fewer leave the peak to chance, more cost time."""
_EVERY, _BASELINES_S = 3, (0.3, 0.8)
"""Motions for focal length and scale start at every third frame and span so long: shorter ones show too little turn,
longer ones lose the corners."""
_CONTRAST = 5.0
"""Height of the edges' best match, in standard deviations of the others, below which nothing is said."""
_SHIFT_PX, _LAG_S = 4.5, 0.033
"""Largest shift (a registered Kinect shows up to 3 px) and lag (one frame) of depth against colour."""
_MASKING_FAULTS = ("distortion", "depth images", "colour images", "depth size", "calibration size", "pairs")
"""Faults that make a measurement of registration or focal length wrong: these are then not judged."""


def examine(recording: Recording) -> list[Finding]:
    """Return the findings of every check that this recording allows; deterministic."""
    wrong_form = [*judge_sizes(recording), *judge_refused(recording)]
    findings = [*wrong_form, *_judge_streams(recording, wrong_form)]
    if not recording.frames:
        return findings
    findings += _judge_pictures(recording)
    frames, camera = recording.paired, recording.camera
    if frames:
        findings += judge_change(frames)
        some = frames[:: max(1, len(frames) // _IMAGES)]
        findings += [judge_valid(some), judge_noise(some)]
    if camera is None:
        advice = "give --camera camera.yaml, or record the camera_info topic as well"
        return [*findings, Finding("calibration", "none came", Verdict.BAD, advice)]
    lens = judge_lens(camera)
    findings.append(lens)
    is_blind = any(finding.verdict is Verdict.BAD and finding.key in _MASKING_FAULTS for finding in findings)
    if frames and not is_blind:
        findings += _judge_geometry(recording, frames, camera)
    return findings


def _judge_streams(recording: Recording, wrong_form: list[Finding]) -> list[Finding]:
    """Judge rates and pairs; what the form of the images explains is not repeated."""
    color, depth, pairs = recording.color_stamps, recording.depth_stamps, len(recording.paired)
    refused = {stream for stream, _ in recording.refused}
    findings = []
    for name, stamps in (("colour", color), ("depth", depth)):
        if name in refused and wrong_form:
            findings.append(Finding(f"{name} frames", f"{len(stamps)} could be used", Verdict.UNKNOWN, "see above"))
        else:
            wrong = {why: count for (stream, why), count in recording.refused_stamps.items() if stream == name}
            findings.append(judge_rhythm(name, stamps, wrong))
    if wrong_form:
        value = f"{pairs} of {len(color)} colour frames have depth"
        return [*findings, Finding("pairs", value, Verdict.UNKNOWN, "see above")]
    return [*findings, judge_pairs(color, depth, pairs)]


def _judge_pictures(recording: Recording) -> list[Finding]:
    frames = recording.frames
    some = frames[:: max(1, len(frames) // _IMAGES)]
    exposure = judge_exposure(some)
    if exposure.verdict is Verdict.BAD:
        return [exposure, Finding("sharpness", "not measured", Verdict.UNKNOWN, "mend the exposure first")]
    return [exposure, judge_blur(some), judge_fixed_parts([frame.color for frame in frames], recording.mask)]


def _judge_geometry(recording: Recording, frames: tuple[RgbdFrame, ...], camera: Camera) -> list[Finding]:
    """Judge registration, lag, focal length and depth scale, which need corners followed through the recording."""
    tracks = follow(frames, camera)
    focal_px = np.array([camera.fx, camera.fy])
    stamps = np.array([frame.stamp for frame in frames], dtype=np.int64)
    shift = _edge_shift(frames, tracks, stamps, camera)
    registration = [_judge_shift(shift), _judge_lag(shift)]
    turned = judge_orientation(frames, shift, lambda others: _edge_shift(others, tracks, stamps, camera))
    registration = turned or registration
    trusted = all(finding.verdict is not Verdict.BAD for finding in registration)
    motions = _long_motions(tracks, stamps, focal_px)
    focal = fit_focal(motions, focal_px) if trusted else None
    calibration = judge_intrinsics(camera, focal, trusted)
    some = frames[:: max(1, len(frames) // _IMAGES)]
    unit = judge_unit(some)
    findings = [*registration, calibration]
    if not recording.truth or unit.verdict is Verdict.BAD:
        return [*findings, unit]
    if not trusted or calibration.verdict is Verdict.BAD:
        why = "mend registration and focal length first"
        return [*findings, Finding("depth scale", "not measured", Verdict.UNKNOWN, why)]
    return [*findings, *_judge_by_truth(recording.truth, tracks, motions, stamps, focal_px, unit)]


def _judge_by_truth(
    truth: Mapping[str, Trajectory],
    tracks: list[Tracks],
    motions: list[PairMotion],
    stamps: Stamps,
    focal_px: Array,
    unit: Finding,
) -> list[Finding]:
    """Judge the truth of the camera, or else of the body seen most, and by it the depth scale, or as `unit` does."""
    poses = chain(tracks, stamps, focal_px)
    is_camera = CAMERA in truth
    name = CAMERA if is_camera else max(truth, key=lambda body: len(truth[body]))
    if written_otherwise := _judge_convention(poses, truth[name], is_camera):
        return [unit, *written_otherwise]
    found = BodyTruth(truth[name], np.eye(3), True) if is_camera else body_truth(poses, truth[name])
    scale = judge_scale(fit_scale(motions, stamps, found) if found else None, name)
    return [unit if scale.verdict is Verdict.UNKNOWN else scale]


def _judge_convention(poses: Trajectory, truth: Trajectory, is_camera: bool) -> list[Finding]:
    """Return the fault that truth, of the camera or of a body, is by another convention, nothing where it is not."""
    mocap = None if is_camera else CalibrationOptions()

    def judge(other: Trajectory) -> Report:
        return judged_by(poses, other, EvaluationOptions(), mocap).report

    try:
        found = judge(truth)
    except InputError:
        return []
    notes = convention_notes(truth, found, judge)
    return [Finding("truth", "other motions than the images show", Verdict.BAD, note) for note in notes]


def _edge_shift(frames: Sequence[RgbdFrame], tracks: list[Tracks], stamps: Stamps, camera: Camera) -> EdgeShift | None:
    focal_px = np.array([camera.fx, camera.fy])
    last = len(frames) - 2
    chosen = sorted({round(k) for k in np.linspace(1, last, _EDGE_FRAMES)}) if last > 1 else []
    motions = []
    for k in chosen:
        motion = pair_motion(tracks, k - 1, k + 1, focal_px)
        motions.append(replace(motion, seconds=float(stamps[k + 1] - stamps[k - 1]) * 1e-9) if motion else None)
    return edge_shift([frames[k] for k in chosen], motions, camera)


def _long_motions(tracks: list[Tracks], stamps: Stamps, focal_px: Array) -> list[PairMotion]:
    """Return motions over a few tenths of a second, from every third frame."""
    motions = []
    for earlier in range(0, len(tracks), _EVERY):
        for seconds in _BASELINES_S:
            later = int(np.searchsorted(stamps, stamps[earlier] + round(seconds * 1e9)))
            motion = pair_motion(tracks, earlier, later, focal_px) if later < len(tracks) else None
            if motion:
                motions.append(motion)
    return motions


def _judge_shift(shift: EdgeShift | None) -> Finding:
    key = "depth registration"
    if shift is None or shift.contrast < _CONTRAST:
        return Finding(key, "too few edges", Verdict.UNKNOWN, "point the camera at objects in front of a background")
    x, y = shift.shift_px
    value = f"colour edges lie {x:+.1f} px right and {y:+.1f} px below depth edges ({shift.edges} of them)"
    advice = (
        "depth is not registered to colour: switch on depth-to-colour registration in the driver, or give the "
        "two intrinsics and the extrinsic so that it can be registered here; where it is recorded so already, "
        "odom calibrate finds the shift in a walk"
    )
    return Finding.judged(key, value, bool(np.hypot(x, y) > _SHIFT_PX), advice)


def _judge_lag(shift: EdgeShift | None) -> Finding:
    key = "depth time"
    if shift is None or shift.contrast < _CONTRAST or not np.isfinite(shift.lag_s):
        return Finding(key, "the camera moved too little to tell", Verdict.UNKNOWN, "move and turn the camera briskly")
    word = "before" if shift.lag_s >= 0 else "after"
    value = f"depth was taken {1e3 * abs(shift.lag_s):.0f} ms {word} the time its stamp says, by colour's clock"
    advice = "colour and depth of a pair show different moments: switch on frame synchronisation, or correct the stamps"
    return Finding.judged(key, value, abs(shift.lag_s) > _LAG_S, advice)
