"""All checks over one stretch of a source, in the order in which faults should be mended."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from odom.evaluation.diagnosis.depth import judge_noise, judge_valid
from odom.evaluation.diagnosis.edges import EdgeShift, edge_shift
from odom.evaluation.diagnosis.finding import Finding, Verdict
from odom.evaluation.diagnosis.image import judge_blur, judge_exposure
from odom.evaluation.diagnosis.motion import FocalFit, PairMotion, fit_focal, pair_motion
from odom.evaluation.diagnosis.scale import BodyTruth, body_truth, fit_scale
from odom.evaluation.diagnosis.timing import judge_pairs, judge_rhythm
from odom.evaluation.diagnosis.tracks import Tracks, follow
from odom.evaluation.trajectory import Stamps, Trajectory
from odom.frame import Camera, RgbdFrame

Array = NDArray[np.float64]

CAMERA_BODY = "camera"

_IMAGES = 30
_EDGE_FRAMES = 36
_BASELINES_S = (0.3, 0.8)
_CONTRAST = 5.0
_SHIFT_PX, _LAG_S = 6.0, 0.033
_FOCAL_SHARE, _FOCAL_UNSURE = 0.09, 0.05
_ASPECT = 0.06
_CENTRE = 0.12
_VIEW_DEG = (30.0, 110.0)
_SCALE_SHARE, _SCALE_UNSURE = 0.025, 0.012


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
        trusted = trusted and calibration.verdict is not Verdict.BAD
        findings.append(_judge_scale(motions, tracks, stamps, focal_px, recording.truth, trusted))
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
    """Return motions over a few tenths of a second, from every third frame on."""
    motions = []
    for earlier in range(0, len(tracks), 3):
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
    if np.hypot(x, y) > _SHIFT_PX:
        return Finding(
            key, value, Verdict.BAD,
            "depth is not registered to colour: switch on depth-to-colour registration in the driver, or give the "
            "two intrinsics and the extrinsic so that it can be registered here",
        )  # fmt: skip
    return Finding(key, value, Verdict.GOOD)


def _judge_lag(shift: EdgeShift | None) -> Finding:
    key = "depth time"
    if shift is None or shift.contrast < _CONTRAST or not np.isfinite(shift.lag_s):
        return Finding(key, "the camera moved too little to tell", Verdict.UNKNOWN, "move and turn the camera briskly")
    word = "before" if shift.lag_s >= 0 else "after"
    value = f"depth was taken {1e3 * abs(shift.lag_s):.0f} ms {word} the time its stamp says, by colour's clock"
    if abs(shift.lag_s) > _LAG_S:
        return Finding(
            key, value, Verdict.BAD,
            "colour and depth of a pair show different moments: switch on frame synchronisation, or correct the stamps",
        )  # fmt: skip
    return Finding(key, value, Verdict.GOOD)


def _judge_calibration(camera: Camera, focal: FocalFit | None, trusted: bool) -> Finding:
    key = "focal length"
    view = np.degrees(2 * np.arctan([camera.width / 2 / camera.fx, camera.height / 2 / camera.fy]))
    value = f"fx {camera.fx:.1f}, fy {camera.fy:.1f} px, view {view[0]:.0f} x {view[1]:.0f} deg"
    centre = np.abs([camera.cx / camera.width - 0.5, camera.cy / camera.height - 0.5]).max()
    advice = (
        "calibrate the colour camera (chessboard) at this image size: these intrinsics belong to another camera, "
        "size or crop"
    )
    sure = focal is not None and focal.sigma.max() < _FOCAL_UNSURE
    if focal is not None and sure:
        fitted = np.array([camera.fx, camera.fy]) / focal.ratio
        value += "; the motion fits " + " and ".join(
            f"{f:.0f} ± {f * s:.0f}" for f, s in zip(fitted, focal.sigma, strict=True)
        )
        if (np.abs(np.log(focal.ratio)) > _FOCAL_SHARE + 2 * focal.sigma).any():
            return Finding(key, value, Verdict.BAD, advice)
    if not _VIEW_DEG[0] < view.max() < _VIEW_DEG[1] or centre > _CENTRE or abs(camera.fx / camera.fy - 1) > _ASPECT:
        return Finding(key, f"{value}; centre {camera.cx:.0f}, {camera.cy:.0f}", Verdict.BAD, advice)
    if not sure:
        why = "turn the camera more to have it measured" if trusted else "mend the registration first"
        return Finding(key, f"{value}: plausible, not measured", Verdict.UNKNOWN, why)
    return Finding(key, value, Verdict.GOOD)


def _judge_scale(
    motions: list[PairMotion], tracks: list[Tracks], stamps: Stamps, focal_px: Array,
    truth: Mapping[str, Trajectory], trusted: bool,
) -> Finding:  # fmt: skip
    key = "depth scale"
    if not trusted:
        return Finding(key, "not measured", Verdict.UNKNOWN, "mend registration and focal length first")
    body = "camera" if CAMERA_BODY in truth else max(truth, key=lambda name: len(truth[name]))
    found: BodyTruth | None
    if body == CAMERA_BODY:
        found = BodyTruth(truth[body], np.eye(3), True)
    else:
        found = body_truth(tracks, stamps, focal_px, truth[body])
    fit = fit_scale(motions, stamps, found) if found else None
    if fit is None or fit.sigma > _SCALE_UNSURE:
        return Finding(
            key, "not measured", Verdict.UNKNOWN, "move the camera farther, and turn it, in view of the mocap"
        )
    value = f"{fit.ratio:.3f} ± {fit.sigma:.3f} of the truth's ({body}), over moves of {fit.usual_m:.2f} m"
    if abs(fit.ratio - 1) > max(_SCALE_SHARE, 2.5 * fit.sigma):
        return Finding(
            key, value, Verdict.BAD,
            f"multiply depth by {1 / fit.ratio:.3f}, or mend depth_scale in camera.yaml (units a metre)",
        )  # fmt: skip
    return Finding(key, value, Verdict.GOOD)
