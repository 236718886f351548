"""The camera of a folder that holds a calibration file for each image, as rtabmap exports them: `calib/STAMP.yaml`."""

import logging
from pathlib import Path

from odom.errors import ConfigError
from odom.frame import Camera
from sensors.calibration_file import read_camera, read_content
from sensors.image_names import visible

log = logging.getLogger(__name__)

_NAME = "camera_name"
"""Key that says which image it was, or nothing: files that differ in it alone are of the same camera."""


def camera_of_all_images(path: Path) -> Camera | None:
    """Return the camera of `calib/*.yaml` where all files say the same one, None where there are none.

    Where they differ, or one cannot be used, that is told with what to give, and None returned.
    """
    files = sorted(visible(path / "calib", "*.yaml"))
    if not files:
        return None
    cameras = dict[Camera, Path]()
    seen = set[str]()
    try:
        for file in files:
            text = "\n".join(line for line in file.read_text().splitlines() if not line.startswith(_NAME))
            if text not in seen:
                seen.add(text)
                cameras.setdefault(read_camera(read_content(file), f"calibration {file}"), file)
            if len(cameras) > 1:
                raise ConfigError("{} and {} are of different cameras".format(*cameras.values()))
    except (ConfigError, OSError, UnicodeDecodeError) as error:
        log.warning(
            "%s: calib/ is left aside: %s; if one is good for all images, give --camera %s", path, error, files[0]
        )
        return None
    (camera,) = cameras
    log.info("%s: calibration of calib/, the same in %d files", path, len(files))
    return camera
