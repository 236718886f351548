"""Colour, depth and features of the newest frame, small enough to be sent on."""

from collections.abc import Iterator

import cv2
import numpy as np
import rerun as rr

from odom.errors import WireError
from odom.frame import Camera
from odom.viewer import entities, palette
from odom.viewer.entities import EntityUpdate, update
from odom.wire import Message, codec
from odom.wire.codec import cdr

_FAR_PERCENT, _INERTIA = 99.5, 0.9
"""The colours of depth end at this percentile, since single pixels are far off. It is smoothed by keeping this share of
the last frame's value: less flickers, more lags behind (0.9: a third of a second)."""
_PNG = (cv2.IMWRITE_PNG_COMPRESSION, 1, cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_RLE)
_FRUSTUM_M = 0.2
"""Depth of the camera's pyramid in the map before the size of the scene is known."""
_STROKES = np.array([[[-0.5, 0.0], [0.0, -0.5]], [[-0.5, 0.5], [0.5, -0.5]], [[0.0, 0.5], [0.5, 0.0]]])
"""Ends of the strokes that hatch a square (3 x 2 x 2), in its sides from its middle."""
_HALF = 2
"""Depth is shown at half its resolution: a quarter of the bytes to the browser, and still finer than its panel."""


class CameraImages:
    """Maps image messages to entities; `median_depth_m` is that of the newest depth image, None before there is one."""

    def __init__(self, jpeg_quality: int) -> None:
        self._quality = jpeg_quality
        self._camera: Camera | None = None
        self._far_mm: float | None = None
        self._frustum_m = _FRUSTUM_M
        self.median_depth_m: float | None = None

    def camera_info(self, message: Message) -> Iterator[EntityUpdate]:
        """Yield the pinholes when the camera has changed."""
        camera = codec.decode_camera_info(message)
        if camera == self._camera:
            return
        self._camera = camera
        yield from self._pinholes(camera)

    def resize(self, frustum_m: float) -> Iterator[EntityUpdate]:
        """Yield the pinholes with pyramids of another depth."""
        self._frustum_m = frustum_m
        if self._camera is not None:
            yield from self._pinholes(self._camera)

    def _pinholes(self, camera: Camera) -> Iterator[EntityUpdate]:
        for path, reduction, color in (
            (entities.COLOR, 1, palette.CORRECTED),
            (entities.DEPTH, _HALF, palette.UNUSED[:3]),
        ):
            yield update(path, None, _pinhole(camera, reduction, color, self._frustum_m))

    def color(self, message: Message) -> Iterator[EntityUpdate]:
        """Yield the colour image as JPEG; a compressed one is passed on unchanged."""
        if message.type_name == cdr.COMPRESSED_IMAGE:
            data = cdr.deserialise(message, cdr.COMPRESSED_IMAGE).data.tobytes()
            media = "image/png" if data.startswith(b"\x89PNG") else "image/jpeg"
        else:
            rgb = codec.decode_color(message)
            bgr = cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR) if rgb.ndim == 3 else rgb
            data = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, self._quality])[1].tobytes()
            media = "image/jpeg"
        yield update(entities.COLOR, message.stamp, rr.EncodedImage(contents=data, media_type=media))

    def depth(self, message: Message) -> Iterator[EntityUpdate]:
        """Yield the depth image at half its resolution as PNG; the range of colours follows the scene slowly."""
        half = np.ascontiguousarray(codec.decode_depth(message)[::_HALF, ::_HALF])
        if len(measured := half[::4, ::4][half[::4, ::4] > 0]):
            far = float(np.percentile(measured, _FAR_PERCENT))
            self._far_mm = far if self._far_mm is None else _INERTIA * self._far_mm + (1.0 - _INERTIA) * far
            self.median_depth_m = 1e-3 * float(np.median(measured))
        data = cv2.imencode(".png", half, _PNG)[1].tobytes()
        archetype = rr.EncodedDepthImage(
            data,
            media_type="image/png",
            meter=1000.0,
            depth_range=(0.0, 1.1 * self._far_mm) if self._far_mm else None,
            colormap=rr.components.Colormap.Viridis,
        )
        yield update(entities.DEPTH, message.stamp, archetype)

    def features(self, message: Message) -> Iterator[EntityUpdate]:
        """Yield the tracked features, coloured by residual."""
        values = codec.decode_points(message)
        if values.shape[1] < 3:
            raise WireError(f"{message.topic}: features need the fields u, v, residual_sigma")
        colors = palette.residual_colors(values[:, 2])
        yield update(entities.FEATURES, message.stamp, rr.Points2D(values[:, :2] + 0.5, colors=colors, radii=-2.2))

    def moving(self, message: Message) -> Iterator[EntityUpdate]:
        """Yield a hatching over the parts of the image that move."""
        values = codec.decode_points(message)
        if values.shape[1] < 3:
            raise WireError(f"{message.topic}: what moves needs the fields u, v, side_px")
        strokes = values[:, None, None, :2] + 0.5 + values[:, None, None, 2:3] * _STROKES
        hatching = rr.LineStrips2D(strokes.reshape(-1, 2, 2), colors=palette.MOVING, radii=-0.6)
        yield update(entities.MOVING, message.stamp, hatching)


def _pinhole(camera: Camera, reduction: int, color: palette.Rgb, depth_m: float) -> rr.Pinhole:
    return rr.Pinhole(
        focal_length=(camera.fx / reduction, camera.fy / reduction),
        principal_point=((camera.cx + 0.5) / reduction, (camera.cy + 0.5) / reduction),
        resolution=(camera.width / reduction, camera.height / reduction),
        camera_xyz=rr.ViewCoordinates.RDF,
        image_plane_distance=depth_m,
        color=color,
        line_width=-1.5,
    )
