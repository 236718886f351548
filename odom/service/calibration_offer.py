"""The calibration file that a run leaves where the one given was poor."""

import logging
import re
from pathlib import Path
from typing import TYPE_CHECKING

from odom.errors import ConfigError, OdomError
from odom.service.unlogged import unlogged
from sensors.calibration_file import Calibration, calibration_text
from sensors.remembered import remember
from sensors.source import SourceOptions

if TYPE_CHECKING:
    from odom.calibration.self_calibration import SelfCalibration

CALIBRATION_FILE = "camera-calibrated.yaml"
"""Its name in the folder of the run."""
_LOG = logging.getLogger(__name__)


def offer_calibration(calibration: "SelfCalibration", folder: Path) -> None:
    """Write the calibration that was found beside the results; raises OSError."""
    from odom.calibration.description import numbers

    if (found := calibration.found) is None:
        return
    story = [f"found by odom run: the calibration given was off by {calibration.off_px:.1f} px", *numbers(found)]
    path = folder / CALIBRATION_FILE
    path.write_text(calibration_text(Calibration(found.camera), story), encoding="utf-8")
    _LOG.info("the calibration given is off by %.1f px: trajectory.txt is adjusted by %s", calibration.off_px, path)


def keep_depth_images(folder: Path, source: str, camera: Path | None) -> None:
    """Give a calibration that was offered the unit of the source's depth images, and how they are registered.

    Raises OSError, and ConfigError or SourceError where the calibration given or the source has vanished.
    """
    from odom.wire.recording import is_recording
    from sensors.depth_registration import registration_text
    from sensors.folder_camera import depth_images_of
    from sensors.replay import open_recording

    path = folder / CALIBRATION_FILE
    if path.is_file():
        with unlogged():  # the sensor has logged what it made of the source
            scale, registration = depth_images_of(source, camera)
            if is_recording(Path(source)):
                registration = open_recording(Path(source), SourceOptions(camera=camera)).registration
        text = re.sub(r"(?m)^depth_scale: .*$", f"depth_scale: {scale!r}", path.read_text(encoding="utf-8"))
        path.write_text(text + ("" if registration is None else registration_text(registration)), encoding="utf-8")


def remember_calibration(folder: Path, serial: str) -> None:
    """Keep an offered calibration for the next runs with the device of that `serial` number, and log it.

    Where nothing can be kept the reason is logged: a run that has ended well does not fail by it.
    """
    offered = folder / CALIBRATION_FILE
    if not offered.is_file():
        _LOG.info("no calibration to remember: the one given was kept, as report.json says")
        return
    try:
        if not serial:
            raise ConfigError("the source is no device with a serial number")
        path = remember(serial, offered.read_text(encoding="utf-8"))
    except (OdomError, OSError) as error:
        _LOG.warning("the calibration cannot be remembered (%s): give it with --camera %s", error, offered)
    else:
        _LOG.info("the calibration is remembered for serial %s: %s; delete it to forget it", serial, path)
