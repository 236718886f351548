"""A folder of images, as the TUM RGB-D benchmark lays it out or others do (see `folder_layouts`), as a recorded source.

Colour files pass unchanged where they are JPEG or PNG; depth is converted to millimetres and rounded once; the ground
truth, if there is any, becomes `truth/camera/pose`.
"""

import heapq
import logging
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from odom.errors import SourceError, WireError
from odom.frame import from_seconds
from odom.wire import Message, Topics, truth
from odom.wire.codec import (
    encode_calibration,
    encode_color,
    encode_color_file,
    encode_depth,
    encode_pose,
)
from odom.wire.codec.deep_images import in_eight_bits
from odom.wire.codec.image_files import OtherFormatError
from sensors.calibration_file import Calibration
from sensors.depth_images import NotDepthError, NotMetresError, depth_table, millimetres
from sensors.depth_registration import DepthRegistration
from sensors.folder_camera import folder_camera
from sensors.folder_layouts import layout_of
from sensors.image_lists import READ_SUFFIXES, FolderLayout, pose_of, steady
from sensors.image_lists import TumEntry as TumEntry
from sensors.image_lists import read_list as read_list
from sensors.image_reading import is_known_to_opencv, read_image
from sensors.source import SourceOptions

log = logging.getLogger(__name__)

BODY = "camera"
_NO_POSE = "no pose"
_MANY_IMAGES = 400
"""Depth images from which on a compiled reader is loaded: it saves 1.7 ms of CPU for each, loading takes 430 ms. With
fewer it costs more than it saves; more, and ordinary recordings do without it. Measured at 640 x 480."""
_TRUTH_MARGIN = 500_000_000
"""Nanoseconds by which ground truth begins before the first image and ends after the last: enough to interpolate."""


class TumSource:
    """The folder as a stream; a file that is missing or damaged is left out, and the first of a kind is logged.

    `refused` counts these by stream (`colour`, `depth`, `truth`) and reason. Truth that cannot be read is done
    without. `is_assumed` when nothing says which camera it is.
    """

    lossless = True

    def __init__(
        self,
        folder: Path,
        calibration: Calibration,
        options: SourceOptions,
        layout: FolderLayout,
        registration: DepthRegistration | None = None,
    ) -> None:
        self.refused: Counter[tuple[str, str]] = Counter()
        self._folder = folder
        self._calibration = calibration
        self.is_assumed = calibration.is_assumed
        self._topics: Topics = options.topics
        color, depth = layout.color, layout.depth
        if not color or not depth:
            raise SourceError(f"{folder}: {layout.name} lists no images of {'depth' if color else 'colour'}")
        zero = min([entry.stamp for entry in (steady(color), steady(depth)) if entry] or [color[0].stamp])
        begin = None if options.start == 0 else zero + from_seconds(options.start)
        end = None if options.end is None else zero + from_seconds(options.end)
        self._color, self._depth = _between(color, begin, end), _between(depth, begin, end)
        self._truth = layout.truth
        if self._color:
            first, last = self._color[0].stamp - _TRUTH_MARGIN, self._color[-1].stamp + _TRUTH_MARGIN
            self._truth = _between(self._truth, first, last)
            _tell_other_time(folder, layout)
        self._table = depth_table(calibration.depth_scale, layout.unknown_depth, layout.rotated_bits)
        self._registration = registration
        self._has_told_metres = False
        self.length: int | None = len(self._color)
        self._closed = False

    def messages(self) -> Iterator[Message]:
        """Yield calibration, then colour, depth and truth in the order of their stamps."""
        if self._color:
            topics = self._topics
            keys = topics.camera_info, topics.depth_info
            yield from encode_calibration(keys, self._color[0].stamp, self._calibration.camera, topics.frame_camera)
        streams = (
            ("truth", self._truth, self._pose),
            ("depth", self._depth, self._depth_image),
            ("colour", self._color, self._color_image),
        )
        tagged = ([(entry, name, encode) for entry in entries] for name, entries, encode in streams)
        for entry, name, encode in heapq.merge(*tagged, key=lambda item: item[0].stamp):
            if self._closed:
                return
            try:
                yield encode(entry)
            except (WireError, OSError, ValueError) as error:
                self._leave_out(name, entry, error)

    def close(self) -> None:
        """End `messages` at the next message, and say what was left out."""
        for damage in () if self._closed else self.damage:
            log.warning("%s: %s", self._folder, damage)
        self._closed = True

    @property
    def damage(self) -> list[str]:
        """What was left out so far, in words."""
        counts = ", ".join(f"{n} of {stream} ({why})" for (stream, why), n in sorted(self.refused.items()))
        return [f"left out {counts}"] if counts else []

    def _leave_out(self, stream: str, entry: TumEntry, error: Exception) -> None:
        kind = stream, _NO_POSE if stream == "truth" else _why(error, self._folder / entry.values[0])
        if not self.refused[kind]:
            what = f"{entry.stamp / 1e9:.6f}" if stream == "truth" else entry.values[0]
            log.warning("%s: left out of %s: %s: %s (more are only counted)", self._folder, stream, what, error)
        self.refused[kind] += 1

    def _color_image(self, entry: TumEntry) -> Message:
        file, topics = (self._folder / entry.values[0]).read_bytes(), self._topics
        try:
            return encode_color_file(topics.color_compressed, entry.stamp, file, topics.frame_camera)
        except OtherFormatError:
            color = read_image(np.frombuffer(file, dtype=np.uint8), cv2.IMREAD_COLOR_RGB | cv2.IMREAD_ANYDEPTH)
            return encode_color(topics.color, entry.stamp, in_eight_bits(color), topics.frame_camera)

    def _depth_image(self, entry: TumEntry) -> Message:
        mm = self._millimetres(np.fromfile(self._folder / entry.values[0], dtype=np.uint8))
        mm = mm if self._registration is None else self._registration(mm)
        return encode_depth(self._topics.depth, entry.stamp, mm, self._topics.frame_camera)

    def _millimetres(self, file: NDArray[np.uint8]) -> NDArray[np.uint16]:
        if len(self._depth) >= _MANY_IMAGES:
            from odom.wire.codec.png_depth import decode_depth_png, is_depth_png  # compiled: loading takes .4 s

            if is_depth_png(file):
                return decode_depth_png(file, self._table)
        depth = read_image(file, cv2.IMREAD_UNCHANGED)
        if depth.dtype.kind == "f" and not self._has_told_metres:
            self._has_told_metres = True
            log.info("%s: its depth images hold numbers with a point: they are taken for metres", self._folder)
        return millimetres(depth, self._table)

    def _pose(self, entry: TumEntry) -> Message:
        return encode_pose(truth(BODY), entry.stamp, pose_of(entry), "mocap")


def _why(error: Exception, file: Path) -> str:
    """Return in few words why an image could not be used, the same for all of a kind.

    Of a file that begins as none of the formats that are read, name and content tell whether it is of another format or
    damaged.
    """
    from odom.evaluation.diagnosis.recording import NO_FILE, NOT_DEPTH, NOT_METRES, OTHER_FORMAT

    if isinstance(error, FileNotFoundError):
        return NO_FILE
    if isinstance(error, OtherFormatError) and (file.suffix.lower() not in READ_SUFFIXES or is_known_to_opencv(file)):
        return OTHER_FORMAT
    if isinstance(error, NotMetresError):
        return NOT_METRES
    return NOT_DEPTH if isinstance(error, NotDepthError) else "damaged file"


def open_tum(path: Path, options: SourceOptions) -> TumSource:
    """Open a TUM RGB-D folder, or one of another layout (see `layout_of`), by its calibration (see `folder_camera`).

    Raises ConfigError when the calibration cannot be used, SourceError when the folder's lists are missing or damaged.
    """
    layout = layout_of(path)
    calibration, registration = folder_camera(path, layout, options.camera)
    return TumSource(path, calibration, options, layout, registration)


def _tell_other_time(folder: Path, layout: FolderLayout) -> None:
    """Log that no true pose is near the images in time, which says nothing of the run and leaves it without truth."""
    first, last = layout.color[0].stamp - _TRUTH_MARGIN, layout.color[-1].stamp + _TRUTH_MARGIN
    if layout.truth and not _between(layout.truth, first, last):
        log.warning(
            "%s: its %d true poses, from %.3f to %.3f s, are of another time than its images, from %.3f to %.3f s: it "
            "goes on without truth; give both the stamps of one clock",
            folder, len(layout.truth), layout.truth[0].stamp / 1e9, layout.truth[-1].stamp / 1e9,
            layout.color[0].stamp / 1e9, layout.color[-1].stamp / 1e9,
        )  # fmt: skip


def _between(entries: list[TumEntry], begin: int | None, end: int | None) -> list[TumEntry]:
    return [
        entry for entry in entries if (begin is None or begin <= entry.stamp) and (end is None or entry.stamp < end)
    ]
