"""What a run says of its camera's calibration in `report.json`."""

import numpy as np

from odom.backend import Odometry
from odom.calibration.parameters import NAMES, TIMINGS, prior_sigma, vector_of
from odom.calibration.self_calibration import SelfCalibration
from odom.errors import ConfigError


def calibration_fields(odometry: Odometry, own: SelfCalibration) -> dict[str, object]:
    """Return the entries of the report: `calibration`, name: [start, now, sigma], and `calibration_off_px`.

    The timing is what the odometry found while it ran. Where the other numbers were kept (see `calibration_kept`),
    their sigma is that of a given calibration.
    """
    found = own.found
    try:
        start = vector_of(odometry.camera)
    except ConfigError:  # a lens that cannot be calibrated
        return {"calibration": _timing(odometry), "calibration_kept": own.reason}
    now, sigma = (start, prior_sigma(odometry.camera)) if found is None else (found.vector, found.sigma)
    slow = zip(NAMES[TIMINGS:], start[TIMINGS:], now[TIMINGS:], sigma[TIMINGS:], strict=True)
    fields: dict[str, object] = {
        "calibration": _timing(odometry) | {name: [float(a), float(b), float(s)] for name, a, b, s in slow},
        "calibration_off_px": round(own.off_px, 2),
    }
    return fields if found is not None else fields | {"calibration_kept": own.reason}


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
