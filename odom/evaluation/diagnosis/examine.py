"""All checks over one stretch of a source, in the order in which faults should be mended."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from odom.evaluation.diagnosis.depth import judge_noise, judge_valid
from odom.evaluation.diagnosis.edges import EdgeShift, edge_shift
from odom.evaluation.diagnosis.finding import Finding, Verdict
from odom.evaluation.diagnosis.image import judge_blur, judge_exposure
from odom.evaluation.diagnosis.motion import FocalFit, PairMotion, fit_focal, pair_motion
from odom.evaluation.diagnosis.scale import BodyTruth, ScaleFit, body_truth, fit_scale
from odom.evaluation.diagnosis.stamps import judge_pairs, judge_rhythm
from odom.evaluation.diagnosis.tracks import Tracks, follow
from odom.evaluation.run_report import CAMERA
from odom.evaluation.trajectory import Stamps, Trajectory
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
_SHIFT_PX, _LAG_S = 6.0, 0.033
"""Largest shift (a registered Kinect shows up to 4 px) and lag (one frame) of depth against colour."""
_FOCAL_SHARE, _FOCAL_UNSURE = 0.09, 0.05
"""Largest error of a focal length as a share of it, beside two sigma; and the sigma above which it is not judged."""
_ASPECT, _CENTRE, _VIEW_DEG = 0.06, 0.12, (30.0, 110.0)
"""What a calibration may be without any motion: fx / fy off one, centre off the middle (shares), and view."""
_SCALE_SHARE, _SCALE_SIGMAS, _SCALE_UNSURE = 0.025, 2.5, 0.012
"""Largest error of the depth scale, as a share and in sigmas; and the sigma above which it is not judged."""


@dataclass(frozen=True, eq=False)
class Recording:
    """A stretch of a source: all stamps of both streams (ns), the frames paired from them, calibration and truth.

    `truth` maps the name of each body of the motion capture to its trajectory.
    """

    color_stamps: Stamps
    depth_stamps: Stamps
    frames: tuple[RgbdFrame, ...]
    camera: Camera | None
    truth: Mapping[str, Trajectory]


def examine(recording: Recording) -> list[Finding]:
    """Return the findings of every check that this recording allows; deterministic."""
    frames, camera = recording.frames, recording.camera
    findings = [
        judge_rhythm("colour", recording.color_stamps),
        judge_rhythm("depth", recording.depth_stamps),
        judge_pairs(recording.color_stamps, recording.depth_stamps, len(frames)),
    ]
    if not frames:
        return findings
    some = frames[:: max(1, len(frames) // _IMAGES)]
    findings += [judge_exposure(some), judge_blur(some), judge_valid(some), judge_noise(some)]
    if camera is None:
        advice = "give --camera camera.yaml, or record the camera_info topic as well"
        return [*findings, Finding("calibration", "none came", Verdict.BAD, advice)]
    tracks = follow(frames, camera)
    focal_px = np.array([camera.fx, camera.fy])
    stamps = np.array([frame.stamp for frame in frames], dtype=np.int64)
    shift = _edge_shift(frames, tracks, stamps, camera)
    registration = [_judge_shift(shift), _judge_lag(shift)]
    trusted = all(finding.verdict is not Verdict.BAD for finding in registration)
    motions = _long_motions(tracks, stamps, focal_px)
    focal = fit_focal(motions, focal_px) if trusted else None
    calibration = _judge_calibration(camera, focal, trusted)
    findings += [*registration, calibration]
    if recording.truth:
        if not trusted or calibration.verdict is Verdict.BAD:
            why = "mend registration and focal length first"
            findings.append(Finding("depth scale", "not measured", Verdict.UNKNOWN, why))
        else:
            truth = recording.truth
            body = CAMERA if CAMERA in truth else max(truth, key=lambda name: len(truth[name]))
            found = (
                BodyTruth(truth[body], np.eye(3), True)
                if body == CAMERA
                else body_truth(tracks, stamps, focal_px, truth[body])
            )
            findings.append(_judge_scale(fit_scale(motions, stamps, found) if found else None, body))
    return findings


def _edge_shift(
    frames: tuple[RgbdFrame, ...], tracks: list[Tracks], stamps: Stamps, camera: Camera
) -> EdgeShift | None:
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
        "two intrinsics and the extrinsic so that it can be registered here"
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


def _judge_calibration(camera: Camera, focal: FocalFit | None, trusted: bool) -> Finding:
    key = "focal length"
    view = np.degrees(2 * np.arctan([camera.width / 2 / camera.fx, camera.height / 2 / camera.fy]))
    value = f"fx {camera.fx:.1f}, fy {camera.fy:.1f} px, view {view[0]:.0f} x {view[1]:.0f} deg"
    centre = np.abs([camera.cx / camera.width - 0.5, camera.cy / camera.height - 0.5]).max()
    advice = (
        "calibrate the colour camera (chessboard) at this image size: these intrinsics belong to another camera, "
        "size or crop"
    )
    if focal is not None and focal.sigma.max() >= _FOCAL_UNSURE:
        focal = None
    if focal is not None:
        fitted = zip(np.array([camera.fx, camera.fy]) / focal.ratio, focal.sigma, strict=True)
        value += "; the motion fits " + " and ".join(f"{f:.0f} ± {f * s:.0f}" for f, s in fitted)
        if (np.abs(np.log(focal.ratio)) > _FOCAL_SHARE + 2 * focal.sigma).any():
            return Finding(key, value, Verdict.BAD, advice)
    if not _VIEW_DEG[0] < view.max() < _VIEW_DEG[1] or centre > _CENTRE or abs(camera.fx / camera.fy - 1) > _ASPECT:
        return Finding(key, f"{value}; centre {camera.cx:.0f}, {camera.cy:.0f}", Verdict.BAD, advice)
    if focal is None:
        why = "turn the camera more to have it measured" if trusted else "mend the registration first"
        return Finding(key, f"{value}: plausible, not measured", Verdict.UNKNOWN, why)
    return Finding(key, value, Verdict.GOOD)


def _judge_scale(fit: ScaleFit | None, body: str) -> Finding:
    key = "depth scale"
    if fit is None or fit.sigma > _SCALE_UNSURE:
        advice = "move the camera farther, and turn it, in view of the mocap"
        return Finding(key, "not measured", Verdict.UNKNOWN, advice)
    value = f"{fit.ratio:.3f} ± {fit.sigma:.3f} of the truth's ({body}), over moves of {fit.usual_m:.2f} m"
    advice = f"multiply depth by {1 / fit.ratio:.3f}, or mend depth_scale in camera.yaml (units a metre)"
    return Finding.judged(key, value, abs(fit.ratio - 1) > max(_SCALE_SHARE, _SCALE_SIGMAS * fit.sigma), advice)
