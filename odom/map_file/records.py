"""The values of a map as the bytes of one row each, and back; every row says by its checksum whose it is."""

import struct
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from odom.backend.map.pose_graph import Edge
from odom.backend.map.saved import SavedDetails, SavedKeyframe, SavedLandmarks
from odom.errors import MapError
from odom.frame import Stamp
from odom.frontend.camera.depth_tilt import DepthTilt
from odom.frontend.camera.noise_monitor import FeatureNoise
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.frontend.camera.sensor_memory import SensorMemory
from odom.frontend.features.measurement import Measurements
from odom.frontend.features.place_descriptor import Place
from odom.geometry.arrays import Array
from odom.map_file.arrays import checked, pack, unchecked, unpack

_UPPER = np.triu_indices(6)
"""The upper triangle of a 6 x 6 covariance: the rest repeats it."""
_UPPER_3 = np.triu_indices(3)
"""The upper triangle of a 3 x 3 one."""
_HEAD = struct.Struct("<qqqqq")
_POSE, _COVARIANCE = 12, 21
"""Numbers of a packed pose (3 x 4), and of a covariance (upper half of 6 x 6)."""
_KEYFRAME = _HEAD.size + 8 * (2 * _POSE + _COVARIANCE)
_EDGE = np.dtype([("a", "<i8"), ("b", "<i8"), ("is_loop", "<i8"), ("T", "<f8", 12), ("covariance", "<f8", 21)])


def keyframe_bytes(k: SavedKeyframe) -> bytes:
    """Return a key frame's row: five integers, two poses (3 x 4), a covariance's upper triangle, and links (int32)."""
    head = _HEAD.pack(k.number, k.session, k.stamp, k.segment, k.first)
    numbers = [k.T_camera_map[:3].ravel(), k.T_middle_stamp[:3].ravel(), k.covariance_since_start[_UPPER]]
    return checked(head + np.concatenate(numbers).astype("<f8").tobytes() + np.array(k.links, dtype="<i4").tobytes())


def keyframe_of(content: bytes) -> SavedKeyframe:
    """Return the key frame of a row; raises MapError where it is damaged."""
    inside = unchecked(content)
    if len(inside) < _KEYFRAME:
        raise MapError("a key frame is cut")
    number, session, stamp, segment, first = _HEAD.unpack_from(inside)
    values = np.frombuffer(inside, "<f8", 2 * _POSE + _COVARIANCE, _HEAD.size)
    links = np.frombuffer(inside, "<i4", offset=_KEYFRAME)
    T, T_stamp = _pose(values[:_POSE]), _pose(values[_POSE : 2 * _POSE])
    covariance = symmetric(values[2 * _POSE :])
    return SavedKeyframe(number, session, Stamp(stamp), segment, first, T, T_stamp, covariance, tuple(links.tolist()))


def at_pose(content: bytes, T_camera_map: Array) -> bytes:
    """Return a key frame's row with another pose; raises MapError where the row is damaged."""
    inside = unchecked(content)
    if len(inside) < _KEYFRAME:
        raise MapError("a key frame is cut")
    pose = T_camera_map[:3].astype("<f8").tobytes()
    return checked(inside[: _HEAD.size] + pose + inside[_HEAD.size + len(pose) :])


def edge_bytes(edge: Edge) -> bytes:
    """Return a registration's row."""
    row = np.zeros((), dtype=_EDGE)
    row["a"], row["b"], row["is_loop"] = edge.a, edge.b, edge.is_loop
    row["T"], row["covariance"] = edge.T_a_b[:3].ravel(), edge.covariance[_UPPER]
    return checked(row.tobytes())


def edges_of(contents: Sequence[bytes]) -> list[Edge]:
    """Return the registrations of n rows; raises MapError where one is damaged."""
    inside = [unchecked(content) for content in contents]
    if any(len(one) != _EDGE.itemsize for one in inside):
        raise MapError("a registration is cut")
    rows = np.frombuffer(b"".join(inside), _EDGE)
    T_a_b = np.tile(np.eye(4), (len(rows), 1, 1))
    T_a_b[:, :3] = rows["T"].reshape(-1, 3, 4)
    covariance = np.zeros((len(rows), 6, 6))
    covariance[:, *_UPPER] = covariance[:, _UPPER[1], _UPPER[0]] = rows["covariance"]
    ends = rows["a"].tolist(), rows["b"].tolist(), T_a_b, covariance, (rows["is_loop"] != 0).tolist()
    return [Edge(*one) for one in zip(*ends, strict=True)]


def details_bytes(number: int, details: SavedDetails) -> bytes:
    """Return the row of what a key frame measured, without its place; covariances are rounded to 24 bits."""
    m, own = details.measurements, details.landmarks
    return pack(
        {
            "number": np.array([number]),
            "timing": details.timing.vector,
            "identities": details.identities,
            "uv": details.uv,
            "values": m.values,
            "jacobian_timing": m.jacobian_timing.astype(np.float32),
            "covariance": m.covariance.astype(np.float32),
            "slope": m.slope.astype(np.float32),
            "landmark_identity": own.identity,
            "landmark_position": own.position,
            "landmark_covariance": _flat(own.covariance),
            "landmark_uv": own.uv,
            "landmark_plane": own.plane.astype(np.float32),
            "landmark_patch_full": own.patch_full,
            "landmark_patch_half": own.patch_half,
            "landmark_seen": own.seen,
            "landmark_tried": own.tried,
            "landmark_assumed": own.assumed.astype(np.uint8),
        }
    )


def details_of(number: int, content: bytes, place: Place | None) -> SavedDetails:
    """Return what key frame `number` measured; raises MapError where the row is damaged or another's."""
    a = _unpacked(number, content)
    timing = ShutterTiming(*a["timing"].tolist())
    measurements = Measurements(
        _wide(a["values"]), _wide(a["jacobian_timing"]), _wide(a["covariance"]), _wide(a["slope"])
    )
    landmarks = SavedLandmarks(
        a["landmark_identity"],
        _wide(a["landmark_position"]),
        _full(a["landmark_covariance"]),
        _wide(a["landmark_uv"]),
        _wide(a["landmark_plane"]),
        a["landmark_patch_full"],
        a["landmark_patch_half"],
        a["landmark_seen"],
        a["landmark_tried"],
        np.asarray(a.get("landmark_assumed", np.zeros(len(a["landmark_tried"]))), dtype=np.bool_),
    )
    return SavedDetails(timing, a["identities"], _wide(a["uv"]), measurements, landmarks, place)


def place_bytes(number: int, place: Place) -> bytes:
    """Return the row of the place that a key frame shows."""
    points, covariances = place.points.astype(np.float32), _flat(place.covariances)
    return pack(
        {"number": np.array([number]), "descriptors": place.descriptors, "points": points, "covariances": covariances}
    )


def place_of(number: int, content: bytes) -> Place:
    """Return the place that key frame `number` shows; raises MapError where the row is damaged or another's."""
    a = _unpacked(number, content)
    return Place(a["descriptors"], _wide(a["points"]), _full(a["covariances"]))


def sensor_bytes(sensor: SensorMemory) -> bytes:
    """Return the row of what is remembered of the camera."""
    tilt = sensor.depth_tilt
    return pack(
        {
            "timing": sensor.timing.vector,
            "timing_information": sensor.timing_information,
            "pixel_sigma": np.array([sensor.noise.pixel_sigma]),
            "inverse_depth_sigma": sensor.noise.inverse_depth_sigma,
            "inflations": np.array([sensor.inflation_by_halves, sensor.inflation_by_jumps]),
            "tilt_angles": tilt.angles,
            "tilt_information": tilt.information,
            "tilt_evidence": tilt.evidence,
            "is_tilt_shown": np.array([tilt.is_shown], dtype=np.int64),
        }
    )


def sensor_of(content: bytes) -> SensorMemory:
    """Return what is remembered of the camera; raises MapError where the row is damaged.

    Older maps do not tell of a tilt: they were made as if there were none.
    """
    a = unpack(content)
    tilt = DepthTilt()
    if "tilt_angles" in a:
        is_shown = bool(a["is_tilt_shown"][0])
        tilt = DepthTilt(a["tilt_angles"], a["tilt_information"], a["tilt_evidence"], is_shown)
    noise = FeatureNoise(float(a["pixel_sigma"][0]), a["inverse_depth_sigma"])
    timing = ShutterTiming(*a["timing"].tolist())
    by_halves, by_jumps = a["inflations"].tolist()
    return SensorMemory(timing, a["timing_information"], noise, by_halves, by_jumps, tilt)


def _unpacked(number: int, content: bytes) -> dict[str, NDArray[Any]]:
    arrays = unpack(content)
    if int(arrays["number"][0]) != number:
        raise MapError(f"what is stored as that of key frame {number} is another's")
    return arrays


def _wide(values: NDArray[Any]) -> Array:
    return values.astype(np.float64)


def _flat(covariances: Array) -> NDArray[np.float32]:
    return covariances[:, _UPPER_3[0], _UPPER_3[1]].astype(np.float32)


def _full(flat: NDArray[Any]) -> Array:
    out = np.zeros((len(flat), 3, 3))
    out[:, _UPPER_3[0], _UPPER_3[1]] = out[:, _UPPER_3[1], _UPPER_3[0]] = flat
    return out


def _pose(values: Array) -> Array:
    T = np.eye(4)
    T[:3] = values.reshape(3, 4)
    return T


def symmetric(upper: Array) -> Array:
    """Return the symmetric 6 x 6 matrix of an upper triangle (21)."""
    out = np.zeros((6, 6))
    out[_UPPER] = out[_UPPER[1], _UPPER[0]] = upper
    return out
