"""An .oni recording as a source, played frame by frame by the real library."""

import heapq
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from odom.errors import DeviceError, OdomError, RecordingError
from odom.frame import Stamp
from odom.wire import Message
from odom.wire.recording.plain_name import named_plainly
from sensors.calibration_file import load_calibration
from sensors.depth_registration import load_depth_registration
from sensors.openni2 import library
from sensors.openni2.device import RawFrame, convert, factory_camera
from sensors.openni2.messages import DeviceEncoder
from sensors.openni2.settings import KinectSettings, Registration
from sensors.source import SourceOptions

FIRST_NS = 1_000_000_000
"""An .oni file holds no date: its stamps count from one second after the epoch, since zero means unknown in ROS."""
PATIENCE_S = 2.0
"""Seconds to wait for a frame that the file's index announces: shorter takes a slow disk for a cut file."""
_PLAYER_STOPS_S = 0.1
"""Seconds between stopping and closing streams: the library crashes when its thread has not noticed the stop."""


def _is_registered(options: SourceOptions, wanted: Registration) -> bool:
    """Return whether to take depth for registered by the driver that recorded it, which an .oni file does not say.

    It is, unless software is asked to do it, or the calibration says how the depth camera stands.
    """
    if wanted is Registration.SOFTWARE:
        return False
    if options.camera is None:
        return True
    return load_depth_registration(options.camera, load_calibration(options.camera).camera) is None


class OniRecording:
    """Colour and depth of an .oni file, in the order of their stamps. Raises RecordingError when it holds no such pair.

    OpenNI2's recorder starts the stamps of each stream at zero, so the file has lost the offset of depth to colour.
    The library frees what is closed even while it is read: one thread at a time holds the file.
    """

    lossless = True

    def __init__(self, path: Path, options: SourceOptions, settings: KinectSettings) -> None:
        if not path.is_file():
            raise RecordingError(f"{path}: no such file")
        self._api = library.load()
        self._path, self._options, self._settings = path, options, settings
        self._held = threading.Lock()
        self._closed = False
        self._device: Any = None
        self._open()

    def _open(self) -> None:
        path, options = self._path, self._options
        place = path.absolute()
        self._streams: list[Any] = []
        try:
            with named_plainly(place, str(place).isascii()) as plain:  # the library crashes on other letters
                self._device = self._api.Device(str(plain).encode())
        except self._api.OpenNIError as error:
            raise RecordingError(f"{path} cannot be read as .oni: {library.said(error)}") from error
        try:
            for name, sensor in (("colour", self._api.SENSOR_COLOR), ("depth", self._api.SENSOR_DEPTH)):
                if not self._device.has_sensor(sensor):
                    raise RecordingError(f"{path} holds no {name} stream")
                self._streams.append(self._device.create_stream(sensor))
            mode = self._streams[0].get_video_mode()
            read = self._settings.model_copy(update={"size": f"{mode.resolutionX}x{mode.resolutionY}"})
            self._encoder = DeviceEncoder(
                options, read, factory_camera(self._streams[0]), _is_registered(options, read.registration)
            )
            self._counts = [int(stream.get_number_of_frames()) for stream in self._streams]
            self._left = list(self._counts)
            self.length: int | None = self._counts[0]
        except (OdomError, self._api.OpenNIError) as error:
            self._release()
            if isinstance(error, OdomError):
                raise
            raise RecordingError(f"{path} cannot be read: {library.said(error)}") from error

    def messages(self) -> Iterator[Message]:
        """Yield the recording from its beginning, or from `start` to `end` seconds after it."""
        with self._held:
            if self._closed:
                return
            if self._left != self._counts:  # played already: the library's own seeking fails
                self._release()
                self._open()
            self._device.playback.set_repeat_enabled(False)
            self._device.playback.set_speed(-1.0)  # the next frame comes when it is asked for
            for stream in self._streams:
                stream.start()
        start_ns = FIRST_NS + round(self._options.start * 1e9)
        end_ns = None if self._options.end is None else FIRST_NS + round(self._options.end * 1e9)
        info_sent = False
        for frame in heapq.merge(self._frames(0), self._frames(1), key=lambda frame: frame.ticks):
            stamp = Stamp(FIRST_NS + frame.ticks * 1000)
            if stamp < start_ns:
                continue
            if end_ns is not None and stamp > end_ns:
                return
            if not info_sent:
                info_sent = True
                yield from self._encoder.info(stamp)
            yield self._encoder.image(frame, stamp)

    def _frames(self, index: int) -> Iterator[RawFrame]:
        """Yield the frames of colour (0) or depth (1) to its end, or until the file is closed."""
        while True:
            with self._held:
                # at the end the library would wait for ever
                if self._closed or self._left[index] <= 0:
                    return
                self._left[index] -= 1
                frame = self._read(index)
            yield frame

    def _read(self, index: int) -> RawFrame:
        stream = self._streams[index]
        try:
            if self._api.wait_for_any_stream([stream], PATIENCE_S) is None:
                missing = self._left[index] + 1
                raise RecordingError(f"{self._path} is cut: {missing} frames of stream {index} do not come")
            frame = stream.read_frame()
        except self._api.OpenNIError as error:
            raise RecordingError(f"{self._path} is damaged: {library.said(error)}") from error
        try:
            return convert(frame, is_color=index == 0)
        except DeviceError as error:
            raise RecordingError(f"{self._path}: {error}") from error
        finally:
            frame.close()

    def close(self) -> None:
        """Give the file back once the frame that is being read has come; `messages` then ends."""
        with self._held:
            self._closed = True
            self._release()

    def _release(self) -> None:
        for stream in self._streams:
            stream.stop()
        if self._streams:
            time.sleep(_PLAYER_STOPS_S)
        for stream in self._streams:
            stream.close()
        self._streams = []
        if self._device is not None:
            self._device.close()
            self._device = None
