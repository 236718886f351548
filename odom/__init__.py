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
    from odom.backend import Estimate as Estimate
    from odom.backend import Odometry as Odometry
    from odom.backend import OdometrySettings as OdometrySettings
    from odom.backend import RelativePose as RelativePose
    from odom.backend import State as State
    from odom.backend import TrajectoryPose as TrajectoryPose
    from odom.calibration.mid_run import MidRunCalibrator as MidRunCalibrator
    from odom.errors import ConfigError as ConfigError
    from odom.errors import InputError as InputError
    from odom.errors import MapError as MapError
    from odom.errors import OdomError as OdomError
    from odom.errors import RecordingError as RecordingError
    from odom.errors import SourceError as SourceError
    from odom.evaluation import EvaluationOptions as EvaluationOptions
    from odom.evaluation import Report as Report
    from odom.evaluation import Trajectory as Trajectory
    from odom.evaluation import evaluate as evaluate
    from odom.evaluation.files import read_tum as read_tum
    from odom.evaluation.files import write_tum as write_tum
    from odom.evaluation.mocap_calibration import calibrate as calibrate
    from odom.frame import Camera as Camera
    from odom.frame import RgbdFrame as RgbdFrame
    from odom.frame import Stamp as Stamp
    from odom.frame import from_seconds as from_seconds
    from odom.frame import to_seconds as to_seconds
    from odom.map_file.map_file import MapFile as MapFile
    from odom.registration import KinectV1 as KinectV1
    from odom.registration import Pairs as Pairs
    from odom.registration import Prior as Prior
    from odom.registration import RecursiveFilter as RecursiveFilter
    from odom.registration import Registration as Registration
    from odom.registration import Verdict as Verdict
    from odom.registration import back_project as back_project
    from odom.registration import point_covariances as point_covariances
    from odom.registration import register as register
    from odom.rgbd_recording import RgbdRecording as RgbdRecording
    from odom.rgbd_recording import read_recording as read_recording

    __version__: str

_NAMES = {
    "backend": "Estimate Odometry OdometrySettings RelativePose State TrajectoryPose",
    "calibration.mid_run": "MidRunCalibrator",
    "errors": "ConfigError InputError MapError OdomError RecordingError SourceError",
    "evaluation": "EvaluationOptions Report Trajectory evaluate",
    "evaluation.files": "read_tum write_tum",
    "evaluation.mocap_calibration": "calibrate",
    "frame": "Camera RgbdFrame Stamp from_seconds to_seconds",
    "map_file.map_file": "MapFile",
    "registration": "KinectV1 Pairs Prior RecursiveFilter Registration Verdict back_project point_covariances register",
    "rgbd_recording": "RgbdRecording read_recording",
}
_HOME = {name: module for module, names in _NAMES.items() for name in names.split()}

__all__ = sorted([*_HOME, "__version__"])


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
