"""The calibration of a camera as sensor_msgs/CameraInfo."""

from collections.abc import Mapping

import numpy as np

from odom.errors import ConfigError, WireError
from odom.frame import Camera, DepthModel, Stamp
from odom.geometry.arrays import Array
from odom.wire.codec import cdr
from odom.wire.codec.image_files import MAX_PIXELS
from odom.wire.codec.image_messages import OPTICAL_FRAME
from odom.wire.message import Message

_DISTORTION: Mapping[str, tuple[int, ...]] = {"plumb_bob": (0, 4, 5), "rational_polynomial": (0, 8, 12, 14), "": (0,)}
"""Distortion models that are supported, with the numbers of coefficients that each may have."""
_DEPTH_MODEL = "odom_depth_model"
"""Distortion model of a message whose coefficients are the vector of a `DepthModel`."""


def encode_camera_info(topic: str, stamp: Stamp, camera: Camera, frame_id: str = OPTICAL_FRAME) -> Message:
    """Return sensor_msgs/CameraInfo of an unrectified image."""
    model = "plumb_bob" if len(camera.distortion) <= 5 else "rational_polynomial"
    return _encode(topic, stamp, camera, frame_id, (model, np.array(camera.distortion, dtype=np.float64)))


def _encode(topic: str, stamp: Stamp, camera: Camera, frame_id: str, bent: tuple[str, Array]) -> Message:
    K, (model, coefficients) = camera.matrix, bent
    return cdr.encode(
        topic,
        cdr.CAMERA_INFO,
        stamp,
        frame_id,
        height=camera.height,
        width=camera.width,
        distortion_model=model,
        d=coefficients,
        k=K.ravel(),
        r=np.eye(3).ravel(),
        p=np.hstack([K, np.zeros((3, 1))]).ravel(),
        binning_x=0,
        binning_y=0,
        roi=cdr.build("sensor_msgs/msg/RegionOfInterest", x_offset=0, y_offset=0, height=0, width=0, do_rectify=False),
    )


def encode_calibration(
    topics: tuple[str, str], stamp: Stamp, camera: Camera, frame_id: str = OPTICAL_FRAME
) -> tuple[Message, ...]:
    """Return the messages of a calibration on the keys of camera_info and depth_info.

    Where the errors of depth are known, the vector of their `DepthModel` comes first.
    """
    info_key, depth_key = topics
    info = encode_camera_info(info_key, stamp, camera, frame_id)
    if camera.depth == DepthModel():
        return (info,)
    return _encode(depth_key, stamp, camera, frame_id, (_DEPTH_MODEL, camera.depth.vector)), info


def decode_depth_model(message: Message) -> DepthModel | None:
    """Return the model of depth errors, None for any other sensor_msgs/CameraInfo; raises WireError if unusable."""
    decoded = cdr.deserialise(message, cdr.CAMERA_INFO)
    if decoded.distortion_model != _DEPTH_MODEL:
        return None
    try:
        return DepthModel.of(decoded.d)
    except ConfigError as error:
        raise WireError(f"{message.topic}: {error}") from error


def decode_camera_info(message: Message, rectified: bool = False) -> Camera:
    """Return the camera of sensor_msgs/CameraInfo; of a `rectified` image its new camera matrix and no distortion.

    Raises WireError for malformed bytes, values that are not finite or a distortion model other than plumb_bob and
    rational_polynomial.
    """
    decoded = cdr.deserialise(message, cdr.CAMERA_INFO)
    (fx, _, cx), (_, fy, cy) = (decoded.p.reshape(3, 4) if rectified else decoded.k.reshape(3, 3))[:2, :3].tolist()
    distortion = () if rectified or not np.any(decoded.d) else tuple(float(value) for value in decoded.d)
    allowed = _DISTORTION.get(decoded.distortion_model)
    if distortion and (allowed is None or len(distortion) not in allowed):
        raise WireError(
            f"{message.topic}: {len(distortion)} coefficients of distortion model {decoded.distortion_model!r} "
            "are not supported: use plumb_bob or rational_polynomial, or rectified images"
        )
    if decoded.width * decoded.height > MAX_PIXELS:
        raise WireError(f"{message.topic}: image size {decoded.width} x {decoded.height} is not plausible")
    try:
        return Camera(decoded.width, decoded.height, fx, fy, cx, cy, distortion)
    except ConfigError as error:
        raise WireError(f"{message.topic}: {error}") from error
