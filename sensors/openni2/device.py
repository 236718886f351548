"""An open OpenNI2 device: sets up, starts and reads its colour and depth streams."""

import logging
import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from odom.errors import DeviceError, OdomError
from odom.frame import Camera
from sensors.openni2 import advice, library
from sensors.openni2.settings import KinectSettings, Registration

_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class RawFrame:
    """One image of the device: RGB (H x W x 3 uint8) or depth (H x W uint16, mm); `ticks` is the device's stamp."""

    is_color: bool
    index: int
    ticks: int
    image: NDArray[Any]


class OpenDevice:
    """Colour and depth of one device. Every method raises DeviceError, with advice, when the device fails.

    `registered` says whether the driver maps depth to colour; `color_camera` are the factory intrinsics: the field
    of view, the centre of the image, no distortion.
    """

    def __init__(self, uri: str, settings: KinectSettings) -> None:
        self._openni2 = library.load()
        self.uri = uri
        self._streams: list[Any] = []
        self._device: Any = None
        try:
            self._device = library.open_device(uri)
            self._start(settings)
        except self._openni2.OpenNIError as error:
            self.close()
            raise advice.cannot_open(uri, library.said(error), advice.usb_cameras()) from error
        except OdomError:
            self.close()
            raise

    def _start(self, settings: KinectSettings) -> None:
        api = self._openni2
        self.serial = serial_number(api, self._device)
        self.name = self._device.get_device_info().name.decode(errors="replace")
        # Depth first: libfreenect's driver asks its depth stream what registration the device can do.
        self._depth = self._stream("depth", api.SENSOR_DEPTH)
        self._color = self._stream("colour", api.SENSOR_COLOR)
        depths = (api.PIXEL_FORMAT_DEPTH_1_MM, api.PIXEL_FORMAT_DEPTH_100_UM)
        _choose_mode(self.uri, "depth", self._depth, settings, depths)
        colors = (api.PIXEL_FORMAT_RGB888, api.PIXEL_FORMAT_YUV422, api.PIXEL_FORMAT_YUYV, api.PIXEL_FORMAT_GRAY8)
        _choose_mode(self.uri, "colour", self._color, settings, colors)
        for stream in (self._color, self._depth):
            if stream.is_property_supported(_MIRRORING):
                stream.set_mirroring_enabled(False)
        if not settings.auto_exposure and self._color.camera is None:
            _log.warning("%s: its driver cannot fix the exposure: auto_exposure=off changes nothing", self.uri)
        elif not settings.auto_exposure:
            self._color.camera.set_auto_exposure(False)
            self._color.camera.set_auto_white_balance(False)
        for stream in (self._color, self._depth):
            stream.start()
        # Both after the start: drivers refuse, or forget, them before.
        self.registered = self._register(settings.registration)
        if settings.sync:
            with suppress(api.OpenNIError):
                self._device.set_depth_color_sync_enabled(True)
        while self.read(0.0) is not None:
            pass  # what was exposed before the registration was set
        self.color_camera = factory_camera(self._color)
        self.depth_camera = factory_camera(self._depth)

    def _stream(self, name: str, sensor: Any) -> Any:
        if not self._device.has_sensor(sensor):
            raise DeviceError(
                f"{self.uri} has no {name} stream in OpenNI2: this odometry needs colour and depth of one device"
            )
        stream = self._device.create_stream(sensor)
        self._streams.append(stream)
        return stream

    def _register(self, wanted: Registration) -> bool:
        mode = self._openni2.IMAGE_REGISTRATION_DEPTH_TO_COLOR
        can = self._device.is_image_registration_mode_supported(mode)
        if wanted in (Registration.AUTO, Registration.DRIVER) and can:
            self._device.set_image_registration_mode(mode)
            return True
        if wanted is Registration.DRIVER:
            raise DeviceError(
                f"{self.uri}: the driver cannot register depth to colour; give --option registration=software and a "
                "calibration file with depth_camera and T_color_depth"
            )
        if can:
            self._device.set_image_registration_mode(self._openni2.IMAGE_REGISTRATION_OFF)
        return False

    def read(self, timeout_s: float) -> RawFrame | None:
        """Wait for the next frame of either stream and copy it; None when none came in `timeout_s`."""
        try:
            stream = self._openni2.wait_for_any_stream([self._color, self._depth], timeout_s)
            if stream is None:
                return None
            frame = stream.read_frame()
        except self._openni2.OpenNIError as error:
            raise DeviceError(f"{self.uri} has stopped delivering: {library.said(error)}") from error
        try:
            return convert(frame, is_color=stream is self._color)
        finally:
            frame.close()

    def close(self) -> None:
        """Stop the streams and give the device back; errors of a device that is gone are ignored."""
        for handle in (*self._streams, *([self._device] if self._device is not None else [])):
            with suppress(self._openni2.OpenNIError):
                handle.close()
        self._streams = []


_MIRRORING, _SERIAL_NUMBER = 7, 3
"""ONI_STREAM_PROPERTY_MIRRORING and ONI_DEVICE_PROPERTY_SERIAL_NUMBER of OniCProperties.h."""


def serial_number(api: ModuleType, device: Any) -> str:
    """Return the device's serial number, empty where its driver does not say it."""
    import ctypes

    if not device.is_property_supported(_SERIAL_NUMBER):
        return ""
    try:
        raw = device.get_property(_SERIAL_NUMBER, ctypes.c_char * 256)
    except api.OpenNIError:
        return ""
    return str(raw.value.decode(errors="replace"))


def _choose_mode(uri: str, name: str, stream: Any, settings: KinectSettings, formats: tuple[Any, ...]) -> None:
    """Set the first of the pixel formats in which the stream has the size and rate asked for."""
    modes = stream.get_sensor_info().videoModes
    sizes = {(mode.pixelFormat.value, mode.resolutionX, mode.resolutionY, mode.fps): mode for mode in modes}
    known = [wanted.value for wanted in formats]
    for code in known:
        mode = sizes.get((code, *settings.width_height, settings.fps))
        if mode is not None:
            stream.set_video_mode(mode)
            return
    offered = sorted({f"{width}x{height} at {fps} Hz" for code, width, height, fps in sizes if code in known})
    raise advice.no_mode(uri, name, f"{settings.size} at {settings.fps} Hz", offered)


def factory_camera(stream: Any) -> Camera | None:
    """Return the camera of the driver's field of view; None where the driver does not say it."""
    mode = stream.get_video_mode()
    try:
        horizontal, vertical = stream.get_horizontal_fov(), stream.get_vertical_fov()
    except library.load().OpenNIError as error:
        _log.debug("no field of view: %s", library.said(error))
        return None
    if not (0 < horizontal < math.pi and 0 < vertical < math.pi):
        return None
    width, height = mode.resolutionX, mode.resolutionY
    fx, fy = 0.5 * width / math.tan(horizontal / 2), 0.5 * height / math.tan(vertical / 2)
    return Camera(width, height, fx, fy, (width - 1) / 2, (height - 1) / 2)


def _plane(frame: Any, dtype: type[np.generic], channels: int) -> NDArray[Any]:
    """Return the frame's pixels as H x W (x channels), a view without the padding of its rows."""
    raw = np.frombuffer(frame.get_buffer_as_uint8(), dtype=np.uint8)[: frame.stride * frame.height]
    row = frame.width * channels * np.dtype(dtype).itemsize
    rows = raw.reshape(frame.height, frame.stride)[:, :row]
    pixels = np.ascontiguousarray(rows).view(dtype)
    return pixels.reshape((frame.height, frame.width, channels) if channels > 1 else (frame.height, frame.width))


# Each returns a copy: the library reuses the buffer for the next frame. Keys are OniPixelFormat's values.
_CONVERT: dict[int, Callable[[Any], NDArray[Any]]] = {
    100: lambda frame: _plane(frame, np.uint16, 1).copy(),
    101: lambda frame: ((_plane(frame, np.uint16, 1) + np.uint32(5)) // 10).astype(np.uint16),
    200: lambda frame: _plane(frame, np.uint8, 3).copy(),
    201: lambda frame: cv2.cvtColor(_plane(frame, np.uint8, 2), cv2.COLOR_YUV2RGB_UYVY),
    202: lambda frame: cv2.cvtColor(_plane(frame, np.uint8, 1), cv2.COLOR_GRAY2RGB),
    205: lambda frame: cv2.cvtColor(_plane(frame, np.uint8, 2), cv2.COLOR_YUV2RGB_YUYV),
}


def convert(frame: Any, is_color: bool) -> RawFrame:
    """Copy the library's frame; raises DeviceError for a pixel format that is not read here."""
    code = frame.videoMode.pixelFormat.value
    if code not in _CONVERT:
        raise DeviceError(f"pixel format {code} of OpenNI2 is not read here")
    return RawFrame(is_color, int(frame.frameIndex), int(frame.timestamp), _CONVERT[code](frame))
