"""Makes wire messages from an OpenNI2 device's images."""

import logging

from odom.errors import ConfigError
from odom.frame import Camera, Stamp
from odom.wire import Message
from odom.wire.codec import Status, encode_status
from sensors.calibration_file import load_calibration
from sensors.default_camera import kinect_camera
from sensors.depth_registration import DepthRegistration, load_depth_registration
from sensors.encoder import ImageEncoder
from sensors.openni2.device import RawFrame
from sensors.openni2.settings import KinectSettings, Registration
from sensors.remembered import remembered_file
from sensors.source import SourceOptions

_log = logging.getLogger(__name__)


class DeviceEncoder:
    """Turns images into messages, depth registered in software where that is asked.

    `camera` is the calibration file's or, without one, that remembered for the device's `serial` number, else
    `factory`, or a Kinect's where the driver says none. Raises ConfigError when the file's is of another size, or when
    software registration lacks its extrinsic.
    """

    def __init__(
        self,
        options: SourceOptions,
        settings: KinectSettings,
        factory: Camera | None,
        registered: bool,
        serial: str = "",
    ) -> None:
        if options.camera:
            camera: Camera | None = load_calibration(options.camera).camera
        else:
            camera = _remembered(serial, settings.width_height) or factory
        if camera is None:
            camera = kinect_camera(*settings.width_height)
            _log.warning(
                "the driver does not say the field of view: an average Kinect's is taken (fx = fy = %.1f px, no "
                "distortion), which is wrong for other devices: give --camera FILE",
                camera.fx,
            )
        self.camera = camera
        if (camera.width, camera.height) != settings.width_height:
            raise ConfigError(f"the calibration is for {camera.width}x{camera.height}, the images are {settings.size}")
        self._device_topic = options.topics.device
        self._images = ImageEncoder(options)
        self._registration = self._software(options, settings, registered)

    def _software(self, options: SourceOptions, settings: KinectSettings, registered: bool) -> DepthRegistration | None:
        if registered or settings.registration is Registration.OFF:
            return None
        found = load_depth_registration(options.camera, self.camera) if options.camera else None
        if found is None and settings.registration is Registration.SOFTWARE:
            raise ConfigError("registration=software needs --camera FILE with depth_camera and T_color_depth")
        if found is None:
            _log.warning(
                "depth is NOT registered to colour: the driver cannot, and no calibration file with depth_camera and "
                "T_color_depth was given; expect wrong odometry"
            )
        return found

    def info(self, stamp: Stamp) -> tuple[Message, ...]:
        """Return the messages of the calibration."""
        return self._images.info(stamp, self.camera)

    def device(self, stamp: Stamp, name: str, missing: list[str], values: dict[str, str]) -> Message:
        """Return the message that says which device this is, which streams are missing and what it lost."""
        level, text = (1, f"no {' and no '.join(missing)}") if missing else (0, "delivering")
        return encode_status(self._device_topic, Status(stamp, name, level, text, values))

    def image(self, frame: RawFrame, stamp: Stamp) -> Message:
        """Return the image's message."""
        if frame.is_color:
            return self._images.color(stamp, frame.image)
        return self._images.depth(stamp, frame.image if self._registration is None else self._registration(frame.image))


def _remembered(serial: str, size: tuple[int, int]) -> Camera | None:
    """Return the camera that `odom run --remember` kept for a device, None where there is none for this image size."""
    try:
        path = remembered_file(serial)
        if not path.is_file():
            return None
        camera = load_calibration(path).camera
    except ConfigError as error:
        if serial:
            _log.warning("no remembered calibration is used: %s", error)
        return None
    if (camera.width, camera.height) != size:
        _log.info("the calibration remembered for serial %s is for images of another size, and not used", serial)
        return None
    _log.info("the calibration remembered for serial %s is used (%s; --camera FILE gives another)", serial, path)
    return camera
