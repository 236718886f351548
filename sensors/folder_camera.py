"""The camera of a folder of images: by a calibration file, its layout or an assumption; and how its depth is stored."""

import logging
from pathlib import Path

import numpy as np

from odom.frame import Camera
from sensors.assumed_unit import tell_unlikely_unit
from sensors.calibration_file import TUM_DEPTH_SCALE, Calibration, calibration_in, depth_scale_alone, read_content
from sensors.default_camera import assumed_calibration, first_size, usual_camera
from sensors.depth_registration import DepthRegistration, in_other_pixels, registration_in
from sensors.folder_layouts import is_image_folder, layout_of
from sensors.image_lists import FolderLayout

log = logging.getLogger(__name__)


def folder_camera(path: Path, layout: FolderLayout, given: Path | None) -> tuple[Calibration, DepthRegistration | None]:
    """Return a folder's calibration, and how its depth is registered where it is that of a camera of its own.

    Without a file, `given` or in the folder, the camera is that of the layout or assumed (see `assumed_calibration`); a
    file that holds `depth_scale` alone leaves it so. Raises ConfigError when the calibration cannot be used.
    """
    file = _calibration_file(path, given)
    content = None if file is None else read_content(file)
    depth_scale = layout.depth_scale
    if file is not None and content is not None:
        alone = depth_scale_alone(content, file)
        if "depth_scale" not in content:
            tell_unlikely_unit(path, layout, file)
        if alone is None:
            calibration = calibration_in(content, file, depth_scale)
            return calibration, _registration(
                path, layout, calibration.camera, registration_in(content, file, calibration.camera)
            )
        depth_scale = alone
    if layout.camera is not None:
        calibration = Calibration(layout.camera, depth_scale)
    else:
        calibration = assumed_calibration(path, first_size(path, layout.color), depth_scale)
    if file is None and (calibration.is_assumed or layout.camera is not None):
        tell_unlikely_unit(path, layout, None)
    return calibration, _registration(path, layout, calibration.camera)


def depth_images_of(source: str, camera: Path | None) -> tuple[float, DepthRegistration | None]:
    """Return what a new calibration keeps of a source's depth images: units a metre, and how they are registered.

    `camera` is the calibration file that was given. Raises ConfigError and SourceError as `open_tum` does.
    """
    path = Path(source)
    layout, file = layout_of(path) if is_image_folder(path) else None, _calibration_file(path, camera)
    usual = TUM_DEPTH_SCALE if layout is None else layout.depth_scale
    if file is not None:
        content = read_content(file)
        alone = depth_scale_alone(content, file)
        if alone is None:
            calibration = calibration_in(content, file, usual)
            found = registration_in(content, file, calibration.camera)
            return calibration.depth_scale, _registration(path, layout, calibration.camera, found)
        usual = alone
    if layout is None:
        return usual, None
    color = layout.camera or usual_camera(path, first_size(path, layout.color))
    return usual, _registration(path, layout, color)


def _calibration_file(path: Path, given: Path | None) -> Path | None:
    return given or (path / "camera.yaml" if (path / "camera.yaml").is_file() else None)


def _registration(
    path: Path, layout: FolderLayout | None, color: Camera, found: DepthRegistration | None = None
) -> DepthRegistration | None:
    """Return how depth is registered: as a file says (`found`), the layout or, of depth in other pixels, its size."""
    if found is not None or layout is None or layout.depth_camera == color:
        return found
    if layout.depth_camera is not None:
        T_color_depth = np.eye(4)
        T_color_depth[:3, 3] = layout.depth_position_m
        return DepthRegistration(layout.depth_camera, color, T_color_depth)
    size, own = first_size(path, layout.depth), (color.width, color.height)
    if size in (None, own) or first_size(path, layout.color) != own:
        return None  # a calibration of another size than colour's is told by whoever pairs the images
    assert size is not None
    other = in_other_pixels(color, size)
    if other is not None:
        log.warning(
            "%s: depth of %d x %d pixels is taken as registered to colour of %d x %d, in other pixels; if it is of "
            "another camera, give depth_camera and T_color_depth in camera.yaml",
            path, *size, color.width, color.height,
        )  # fmt: skip
    return other
