"""RGB-D odometry: where a camera is, by its colour and depth images, with an honest covariance.

Give it frames one by one, as numpy arrays; here the camera moves along a wall, 5.7 mm between frames:

>>> import numpy as np, odom
>>> camera = odom.Camera(width=320, height=240, fx=262.5, fy=262.5, cx=159.5, cy=119.5)
>>> wall = np.kron(np.random.default_rng(0).integers(0, 256, (40, 60)), np.ones((8, 8))).astype(np.uint8)
>>> depth_mm = np.full((240, 320), 1500, np.uint16)
>>> odometry = odom.Odometry(camera)
>>> for i in range(10):
...     stamp = odom.from_seconds(i / 30)
...     frame = odom.RgbdFrame(i, stamp, wall[:240, i : i + 320], stamp, depth_mm)
...     estimate = odometry.process(frame)
>>> estimate.state
<State.TRACKING: 'TRACKING'>
>>> round(float(estimate.T_odom_camera[0, 3]), 2), estimate.covariance.shape
(0.05, (6, 6))

The motion between two point sets with covariances:

>>> points = np.random.default_rng(0).uniform(-1, 1, (100, 3))
>>> variances = np.full((100, 3), 1e-6)
>>> found = odom.register(odom.Pairs(points, points + [0.1, 0, 0], variances, variances))
>>> found.ok, np.round(found.T_target_source[:3, 3], 3)
(True, array([0.1, 0. , 0. ]))

The errors of a trajectory, here with every other pose a centimetre off. `odom.Trajectory.of(odometry.finish())` is that
of the odometry; `odom.read_recording(path)` gives the frames and the truth of a recording:

>>> T = np.tile(np.eye(4), (20, 1, 1))
>>> T[:, 0, 3], T[:, 1, 3] = np.arange(20), np.sin(np.arange(20))
>>> truth = odom.Trajectory(np.arange(20) * 100_000_000, T)
>>> T_off = T.copy()
>>> T_off[::2, 2, 3] += 0.01
>>> estimate = odom.Trajectory(truth.stamps, T_off)
>>> round(odom.evaluate(estimate, truth).ate_m, 3)
0.005

Names are imported on first use: `import odom` itself is cheap.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from odom.backend import Estimate, Odometry, OdometrySettings, RelativePose, State, TrajectoryPose
    from odom.calibration.mid_run import MidRunCalibrator
    from odom.errors import ConfigError, InputError, MapError, OdomError, RecordingError, SourceError
    from odom.evaluation import EvaluationOptions, Report, Trajectory, evaluate
    from odom.evaluation.files import read_tum, write_tum
    from odom.evaluation.mocap_calibration import calibrate
    from odom.frame import Camera, RgbdFrame, Stamp, from_seconds, to_seconds
    from odom.map_file.map_file import MapFile
    from odom.registration import (
        KinectV1,
        Pairs,
        Prior,
        RecursiveFilter,
        Registration,
        Verdict,
        back_project,
        point_covariances,
        register,
    )
    from odom.rgbd_recording import RgbdRecording, read_recording

    __version__: str

__all__ = [
    "Camera",
    "ConfigError",
    "Estimate",
    "EvaluationOptions",
    "InputError",
    "KinectV1",
    "MapError",
    "MapFile",
    "MidRunCalibrator",
    "OdomError",
    "Odometry",
    "OdometrySettings",
    "Pairs",
    "Prior",
    "RecordingError",
    "RecursiveFilter",
    "Registration",
    "RelativePose",
    "Report",
    "RgbdFrame",
    "RgbdRecording",
    "SourceError",
    "Stamp",
    "State",
    "Trajectory",
    "TrajectoryPose",
    "Verdict",
    "__version__",
    "back_project",
    "calibrate",
    "evaluate",
    "from_seconds",
    "point_covariances",
    "read_recording",
    "read_tum",
    "register",
    "to_seconds",
    "write_tum",
]

_HOMES = {
    "backend": ("Estimate", "Odometry", "OdometrySettings", "RelativePose", "State", "TrajectoryPose"),
    "calibration.mid_run": ("MidRunCalibrator",),
    "errors": ("ConfigError", "InputError", "MapError", "OdomError", "RecordingError", "SourceError"),
    "evaluation": ("EvaluationOptions", "Report", "Trajectory", "evaluate"),
    "evaluation.mocap_calibration": ("calibrate",),
    "evaluation.files": ("read_tum", "write_tum"),
    "frame": ("Camera", "RgbdFrame", "Stamp", "from_seconds", "to_seconds"),
    "map_file.map_file": ("MapFile",),
    "registration": (
        "KinectV1",
        "Pairs",
        "Prior",
        "RecursiveFilter",
        "Registration",
        "Verdict",
        "back_project",
        "point_covariances",
        "register",
    ),
    "rgbd_recording": ("RgbdRecording", "read_recording"),
}
_HOME = {name: module for module, names in _HOMES.items() for name in names}


if not TYPE_CHECKING:  # a type checker would take every misspelt name for one that is there

    def __getattr__(name: str) -> Any:
        """Import the module that defines `name`."""
        if name == "__version__":
            value: Any = _version()
        elif name in _HOME:
            value = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
        else:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


def _version() -> str:
    """Return the installed version, `unknown` for a checkout that was never installed."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("rgbd-odom")
    except PackageNotFoundError:
        return "unknown"
