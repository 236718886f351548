"""The camera of a folder or file without calibration: a data set's by the folder's name, else an average Kinect's."""

import logging
import re
from collections.abc import Sequence
from pathlib import Path

from odom.frame import Camera
from sensors.calibration_file import Calibration
from sensors.image_lists import TumEntry
from sensors.image_reading import image_in

log = logging.getLogger(__name__)

_SIZE = (640, 480)
"""Width and height of a Kinect's images, pixels."""
_TUM = {
    "1": Camera(*_SIZE, 517.306408, 516.469215, 318.643040, 255.313989,
                (0.262383, -0.953104, -0.005358, 0.002628, 1.163314)),
    "2": Camera(*_SIZE, 520.908620, 521.007327, 325.141442, 249.701764,
                (0.231222, -0.784899, -0.003257, -0.000105, 0.917205)),
    "3": Camera(*_SIZE, 535.4, 539.2, 320.1, 247.6),
}  # fmt: skip
"""Intrinsics of the colour cameras freiburg1, 2 and 3, as the TUM RGB-D benchmark publishes them; the third's images
are undistorted already."""
_TUM_NAME = re.compile(r"(?:^|[^a-z])(?:freiburg|fr)([123])(?![0-9])", re.IGNORECASE)
ICL_NUIM = Camera(*_SIZE, 481.2, 480.0, 319.5, 239.5)
"""The camera that drew ICL-NUIM's rooms, its y axis turned to point down as everyone else's."""
_PUBLISHED = (
    (
        re.compile(r"rgbd_bonn", re.IGNORECASE),
        Camera(
            *_SIZE, 542.822841, 542.576870, 315.593520, 237.756098, (0.039903, -0.099343, -0.000730, -0.000144, 0.0)
        ),
    ),
    (re.compile(r"icl[-_]?nuim|living_?room_?traj|office_?room_?traj", re.IGNORECASE), ICL_NUIM),
)
"""Cameras of other data sets by the names of their folders: Bonn's dynamic scenes, ICL-NUIM's drawn rooms."""
_MOST_DAMAGED = 10
"""Damaged images at the beginning behind which a whole one is looked for. Larger: a folder of damaged ones opens late;
smaller: the camera that its files describe is missed. Chosen by hand."""
_KINECT_FX = 525.0
"""Focal length of a Kinect v1 at 640 pixels width, as its driver gives it; a device's own is within 3 %."""


def kinect_camera(width: int, height: int) -> Camera:
    """Return the camera of an average Kinect v1 for images of this size: square pixels, no distortion."""
    focal = _KINECT_FX * width / _SIZE[0]
    return Camera(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2)


def tum_camera(folder: Path, size: tuple[int, int] | None) -> Camera | None:
    """Return the published camera of a data set by its folder's name, None when the name or image size is another."""
    if size not in (_SIZE, None):
        return None
    for name in (folder.absolute().name, folder.resolve().name):
        if found := _TUM_NAME.search(name):
            return _TUM[found[1]]
        if published := next((camera for pattern, camera in _PUBLISHED if pattern.search(name)), None):
            return published
    return None


def usual_camera(folder: Path, size: tuple[int, int] | None) -> Camera:
    """Return the camera of a folder without calibration: its data set's by the name, else an average Kinect's."""
    return tum_camera(folder, size) or kinect_camera(*(size or _SIZE))


def assumed_calibration(folder: Path, size: tuple[int, int] | None, depth_scale: float) -> Calibration:
    """Return the calibration of a folder that has none, and log which was taken and how to do better.

    `size` is that of its colour images, None when none can be read.
    """
    camera = usual_camera(folder, size)
    if tum_camera(folder, size) is not None:
        log.info("%s: no camera.yaml; by the folder's name the published calibration of its data set is taken", folder)
        return Calibration(camera, depth_scale)
    log.warning(
        "%s has no calibration: an average Kinect's is taken (fx = fy = %.1f px, no distortion, %g depth units a "
        "metre), which costs accuracy and is wrong for other cameras: put camera.yaml into the folder, or give "
        "--camera FILE (README has an example; for depth in millimetres alone, the line depth_scale: 1000 is enough)",
        folder, camera.fx, depth_scale,
    )  # fmt: skip
    return Calibration(camera, depth_scale, is_assumed=True)


def first_size(folder: Path, entries: Sequence[TumEntry]) -> tuple[int, int] | None:
    """Return width and height of the first image of a list that can be read, None when all the first are damaged."""
    sizes = (_size(folder / entry.values[0]) for entry in entries[:_MOST_DAMAGED])
    return next((size for size in sizes if size is not None), None)


def _size(file: Path) -> tuple[int, int] | None:
    image = image_in(file)
    return None if image is None else (image.shape[1], image.shape[0])
