"""The calibration of a run: how it is mended on the way, what is kept at the end, and what is said of it."""

import threading
from collections.abc import Callable

import numpy as np

from odom.backend import Odometry, OdometrySettings
from odom.calibration.mid_run import MidRunCalibrator
from odom.calibration.parameters import NAMES, TIMINGS, prior_sigma, vector_of
from odom.calibration.self_calibration import SelfCalibration, self_calibrated
from odom.errors import ConfigError

_LEAST_TRACKED = 0.6
"""Share of frames tracked below which the rest, which the calibration may have lost, would be judged by the few."""


def calibrator_for(
    settings: OdometrySettings, has_map: bool, ready: threading.Event, may_wait: Callable[[], bool]
) -> MidRunCalibrator | None:
    """Return the calibrator of a running odometry, None where it keeps the given calibration.

    A map on disk stays with the camera that it was made with. Until the calibrator's code is `ready`, frames of a
    source that `may_wait` wait.
    """
    return MidRunCalibrator(ready, may_wait) if settings.self_calibration and not has_map else None


def latest_calibration(odometry: Odometry) -> SelfCalibration | None:
    """Return the calibration found during the run and in use since then, None where there is none."""
    calibrator, is_changed = odometry.calibrator, odometry.camera_in_use is not odometry.camera
    return calibrator.latest if is_changed and isinstance(calibrator, MidRunCalibrator) else None


def final_calibration(odometry: Odometry, has_map: bool, tracked: float) -> SelfCalibration:
    """Return the calibration that a whole run shows, or the reason for which the given one is kept.

    `tracked` is the share of its frames with a pose that may be trusted.
    """
    if not odometry.settings.self_calibration:
        return SelfCalibration(reason="odometry.self_calibration is off")
    if has_map:
        return SelfCalibration(reason="the map is kept with the camera that it was made with")
    if isinstance(odometry.calibrator, MidRunCalibrator) and not odometry.calibrator.wait():
        return SelfCalibration(reason="the run was stopped while the code that calibrates was still being compiled")
    latest = latest_calibration(odometry)
    if latest is None and tracked < _LEAST_TRACKED:
        return SelfCalibration(
            reason=f"only {tracked:.0%} of the frames were tracked, too few to calibrate by: see to what lost the "
            "camera (`odom doctor` looks for the cause), and run again"
        )
    return self_calibrated(odometry, latest)


def calibration_fields(odometry: Odometry, calibration: SelfCalibration) -> dict[str, object]:
    """Return the entries of the report: `calibration`, name: [start, now, sigma], and `calibration_off_px`.

    The timing is what the odometry found while it ran. Where the other numbers were kept (see `calibration_kept`),
    their sigma is that of a given calibration.
    """
    found = calibration.found
    try:
        start = vector_of(odometry.camera)
    except ConfigError:  # a lens that cannot be calibrated
        return {"calibration": _timing(odometry), "calibration_kept": calibration.reason}
    now, sigma = (start, prior_sigma(odometry.camera)) if found is None else (found.vector, found.sigma)
    slow = zip(NAMES[TIMINGS:], start[TIMINGS:], now[TIMINGS:], sigma[TIMINGS:], strict=True)
    fields: dict[str, object] = {
        "calibration": _timing(odometry) | {name: [float(a), float(b), float(s)] for name, a, b, s in slow},
        "calibration_off_px": round(calibration.off_px, 2),
    }
    return fields if found is not None else fields | {"calibration_kept": calibration.reason}


def calibration_status(odometry: Odometry) -> dict[str, str]:
    """Return what a status says of the camera that frames are tracked by: its focal lengths and centre, in pixels."""
    camera = odometry.camera_in_use
    names = ("fx", "fy", "cx", "cy")
    origin = "given" if camera is odometry.camera else "found on the way"
    return {"calibration": origin} | {name: f"{getattr(camera, name):.1f}" for name in names}


def _timing(odometry: Odometry) -> dict[str, list[float]]:
    s, sensor = odometry.settings, odometry.sensor
    start = (s.readout_prior_s, s.depth_lag_prior_s, s.depth_readout_prior_s)
    sigma = np.sqrt(np.diag(np.linalg.inv(sensor.timing_information)))
    rows = zip(NAMES[:TIMINGS], start, sensor.timing.vector, sigma, strict=True)
    return {name: [float(a), float(b), float(c)] for name, a, b, c in rows}
