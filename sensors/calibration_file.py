"""Calibration files: the YAML that ROS's camera_calibration writes, plus the unit of a folder's depth images.

OpenCV's own YAML is read as well (see `opencv_calibration`).
"""

from collections.abc import Iterable
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import yaml

from odom.errors import ConfigError
from odom.frame import Camera, DepthModel
from sensors.opencv_calibration import is_opencv_yaml, opencv_content

TUM_DEPTH_SCALE = 5000.0
"""Units per metre of the depth images of the TUM RGB-D benchmark."""


@dataclass(frozen=True)
class Calibration:
    """A camera, and `depth_scale`: units of the depth image per metre; `is_assumed` when nothing says which camera."""

    camera: Camera
    depth_scale: float = TUM_DEPTH_SCALE
    is_assumed: bool = False


def load_calibration(path: Path, depth_scale: float = TUM_DEPTH_SCALE) -> Calibration:
    """Read a ROS camera-calibration YAML, or OpenCV's; `depth_scale` is that of a file that gives none.

    Raises ConfigError naming the field that is missing or unusable.
    """
    return calibration_in(read_content(path), path, depth_scale)


def calibration_in(content: dict[Any, Any], path: Path, depth_scale: float = TUM_DEPTH_SCALE) -> Calibration:
    """Return the calibration in what a file holds; raises ConfigError as above."""
    return Calibration(read_camera(content, f"calibration {path}"), _depth_scale(content, path, depth_scale))


def depth_scale_alone(content: dict[Any, Any], path: Path) -> float | None:
    """Return the depth scale of a file that holds nothing else, None of any other; raises ConfigError as above."""
    return _depth_scale(content, path) if content.keys() == {"depth_scale"} else None


def read_content(path: Path) -> dict[Any, Any]:
    """Return what a calibration file holds under ROS's keys; raises ConfigError when it cannot be read."""
    try:
        text = path.read_text(encoding="utf-8-sig")
        if is_opencv_yaml(text):
            return opencv_content(path, text)
        content = yaml.safe_load(text)
    except (OSError, ValueError, RecursionError, yaml.YAMLError) as error:
        raise ConfigError(f"calibration {path} cannot be read: {' '.join(str(error).split())}") from error
    if not isinstance(content, dict):
        raise ConfigError(f"calibration {path} is not a ROS camera-calibration YAML")
    return content


def _depth_scale(content: dict[Any, Any], path: Path, usual: float = TUM_DEPTH_SCALE) -> float:
    try:
        scale = float(content.get("depth_scale", usual))
    except (TypeError, ValueError, OverflowError) as error:
        raise ConfigError(f"calibration {path}: depth_scale is not a number: {error}") from error
    if not 1 <= scale <= 1e6:
        raise ConfigError(f"calibration {path}: depth_scale {scale} units per metre is not plausible")
    return scale


def read_camera(content: Any, place: str) -> Camera:
    """Return the camera under ROS's keys; raises ConfigError naming `place` and the field that is unusable."""
    try:
        model = content.get("distortion_model", "plumb_bob")
        if model not in ("plumb_bob", "rational_polynomial"):
            raise ConfigError(f"distortion model {model!r}: give plumb_bob or rational_polynomial")
        fx, fy, cx, cy = _focal_lengths_and_centre(_numbers(content["camera_matrix"]["data"]))
        distortion = _numbers(content.get("distortion_coefficients", {}).get("data", []))
        size = int(content["image_width"]), int(content["image_height"])
        lens = distortion if any(distortion) else ()
        return Camera(*size, fx, fy, cx, cy, lens, _depth_model(content))
    except ConfigError as error:
        raise ConfigError(f"{place}: {error}") from error
    except KeyError as error:
        raise ConfigError(f"{place} lacks {error.args[0]}; README shows a whole file") from error
    except (TypeError, AttributeError, ValueError, OverflowError) as error:
        raise ConfigError(f"{place}: not a number: {error}; README shows a whole file") from error


def _focal_lengths_and_centre(matrix: tuple[float, ...]) -> tuple[float, float, float, float]:
    if len(matrix) != 9:
        raise ConfigError(f"camera_matrix has {len(matrix)} values: give 9")
    fx, _, cx, _, fy, cy, *last = matrix
    if last != [0.0, 0.0, 1.0]:
        row = " ".join(f"{value:g}" for value in last)
        remedy = "give fx 0 cx, 0 fy cy, 0 0 1"
        if cx == cy == 0.0 and last[2] == 1.0:
            remedy = "it is written column by column, as MATLAB keeps it: " + remedy
        elif last[:2] == [0.0, 0.0] and last[2] != 0.0:
            remedy = "divide all nine values by the last"
        raise ConfigError(f"camera_matrix has the last row {row}, not 0 0 1: {remedy}")
    return fx, fy, cx, cy


def _depth_model(content: Any) -> DepthModel:
    given = content.get("depth_model", {})
    unknown = set(given) - {field.name for field in fields(DepthModel)}
    if unknown:
        raise ConfigError(f"depth_model: {', '.join(sorted(map(str, unknown)))} is unknown")
    values: dict[str, Any] = {name: _numbers(numbers) for name, numbers in given.items()}
    return DepthModel(**values)


def calibration_text(calibration: Calibration, remarks: Iterable[str] = ()) -> str:
    """Return a calibration as the text of a file that `load_calibration` reads, below `remarks`, one a line."""
    camera = calibration.camera
    content = camera_keys(camera) | {"depth_scale": calibration.depth_scale}
    if camera.depth != DepthModel():
        content["depth_model"] = {
            name: [round(value, 7) for value in values] for name, values in asdict(camera.depth).items()
        }
    lines = [f"# {remark}".rstrip() + "\n" for remark in remarks]
    return "".join(lines) + as_yaml(content)


def camera_keys(camera: Camera) -> dict[str, Any]:
    """Return a camera under ROS's keys, as `read_camera` takes it, without how depth errs."""
    K = [round(float(value), 4) for value in camera.matrix.ravel()]
    return {
        "image_width": camera.width,
        "image_height": camera.height,
        "camera_name": "camera",
        "camera_matrix": {"rows": 3, "cols": 3, "data": K},
        "distortion_model": "plumb_bob" if len(camera.distortion) <= 5 else "rational_polynomial",
        "distortion_coefficients": _row(camera.distortion or (0.0,) * 5),
    }


def as_yaml(content: dict[str, Any]) -> str:
    """Return keys in their order as lines of a calibration file."""
    return str(yaml.safe_dump(content, sort_keys=False, default_flow_style=None, width=120))


def _row(values: tuple[float, ...]) -> dict[str, Any]:
    return {"rows": 1, "cols": len(values), "data": [round(value, 7) for value in values]}


def _numbers(values: Any) -> tuple[float, ...]:
    return tuple(float(value) for value in values)
