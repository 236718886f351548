"""Registers depth to colour in software: two intrinsics and an extrinsic, for devices whose driver cannot."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from odom.errors import ConfigError
from odom.frame import Camera
from odom.geometry.arrays import Array
from sensors.calibration_file import as_yaml, camera_keys, read_camera, read_content


@dataclass(frozen=True, eq=False)
class DepthRegistration:
    """What maps the depth camera's pixels to the colour camera's: both cameras and `T_color_depth` (4 x 4, metres).

    Raises ConfigError when `T_color_depth` is not a rigid motion.
    """

    depth_camera: Camera
    color_camera: Camera
    T_color_depth: Array

    def __post_init__(self) -> None:
        T = self.T_color_depth
        affine = T.shape == (4, 4) and np.isfinite(T).all() and np.array_equal(T[3], (0, 0, 0, 1))
        rotation = T[:3, :3] if affine else np.zeros((3, 3))
        if not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-3) or np.linalg.det(rotation) < 0:
            raise ConfigError("T_color_depth: give a 4 x 4 rigid motion from the depth to the colour camera, in metres")

    @cached_property
    def _corner_rays(self) -> Array:
        """(H + 1) x (W + 1) x 3 directions of the depth pixels' corners, of depth 1, in the colour camera's axes."""
        camera = self.depth_camera
        u, v = np.meshgrid(np.arange(camera.width + 1) - 0.5, np.arange(camera.height + 1) - 0.5)
        pixels = np.stack([u.ravel(), v.ravel()], axis=1)[:, None, :]
        normal = cv2.undistortPoints(pixels, camera.matrix, np.array(camera.distortion) if camera.distortion else None)
        rays = np.concatenate([normal[:, 0, :], np.ones((len(pixels), 1))], axis=1)
        return np.ascontiguousarray((rays @ self.T_color_depth[:3, :3].T).reshape(*u.shape, 3))

    def __call__(self, depth_mm: NDArray[np.uint16]) -> NDArray[np.uint16]:
        """Return the depth image (H x W uint16, mm, 0 unknown) as the colour camera sees it, in its size.

        Every depth pixel is a small square facing the depth camera; it covers the colour pixels between its projected
        corners, so that neighbours leave no gaps, and the nearest surface wins. Raises ConfigError when the image has
        not the depth camera's size.
        """
        camera, seen = self.color_camera, self.depth_camera
        height, width = depth_mm.shape
        if (width, height) != (seen.width, seen.height):
            raise ConfigError(f"depth_camera is for {seen.width}x{seen.height}, the depth images are {width}x{height}")
        distortion = np.zeros(14)
        distortion[: len(camera.distortion)] = camera.distortion
        registered = np.full((camera.height, camera.width), np.iinfo(np.uint16).max, dtype=np.uint16)
        shift = self.T_color_depth[:3, 3] * 1e3
        intrinsics = (camera.fx, camera.fy, camera.cx, camera.cy)
        from sensors.depth_splat import splat  # imported here: most sources need neither this nor the compiler

        splat(depth_mm, self._corner_rays, shift, intrinsics, distortion, registered)
        registered[registered == np.iinfo(np.uint16).max] = 0
        return registered


def in_other_pixels(camera: Camera, size: tuple[int, int]) -> DepthRegistration | None:
    """Return the registration of depth that is registered to a camera already, but has other pixels: `size`.

    It is None where width and height are not the camera's by one factor: such depth is of another camera.
    """
    width, height = size
    if width * camera.height != height * camera.width:
        return None
    k = width / camera.width
    cx, cy = (k * (c + 0.5) - 0.5 for c in (camera.cx, camera.cy))  # pixel centres are at whole numbers
    depth_camera = Camera(width, height, k * camera.fx, k * camera.fy, cx, cy, camera.distortion)
    return DepthRegistration(depth_camera, camera, np.eye(4))


def load_depth_registration(path: Path, color_camera: Camera) -> DepthRegistration | None:
    """Return what the calibration file says about the depth camera, None when it says nothing.

    Beside ROS's keys for the colour camera the YAML file may hold `depth_camera` (the same keys again), `T_color_depth`
    (`data`: 16 numbers, row by row, metres) and `registered_to` (a camera): depth is then registered to that camera,
    for which depth's errors were found, and not to the colour camera. Raises ConfigError when one is missing or
    malformed.
    """
    return registration_in(read_content(path), path, color_camera)


def registration_in(document: dict[Any, Any], path: Path, color_camera: Camera) -> DepthRegistration | None:
    """Return what a calibration file's content says about the depth camera; raises ConfigError as above."""
    if not {"depth_camera", "T_color_depth"} & document.keys():
        return None
    missing = [name for name in ("depth_camera", "T_color_depth") if name not in document]
    if missing:
        raise ConfigError(
            f"{path}: {missing[0]} is missing: software registration needs depth_camera and T_color_depth"
        )
    camera = read_camera(document["depth_camera"], f"{path}, depth_camera")
    try:
        T = np.array([float(value) for value in document["T_color_depth"]["data"]]).reshape(4, 4)
        target = (
            read_camera(document["registered_to"], "registered_to") if "registered_to" in document else color_camera
        )
        return DepthRegistration(camera, target, T)
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from error
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise ConfigError(f"{path}: T_color_depth: give data, 16 numbers row by row: {error}") from error


def registration_text(registration: DepthRegistration) -> str:
    """Return the lines of a calibration file that keep the registration with which the calibration was found."""
    return as_yaml(
        {
            "depth_camera": camera_keys(registration.depth_camera),
            "T_color_depth": {"rows": 4, "cols": 4, "data": registration.T_color_depth.ravel().tolist()},
            "registered_to": camera_keys(registration.color_camera),
        }
    )
