"""A coloured triangle mesh as PLY and as binary glTF.

Source: Khronos, "glTF 2.0 Specification", 2021, section 4.4 (GLB). Its y axis points up, that of `map` down.
"""

import json
import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from odom.geometry.arrays import Array

_GLTF_MAP = np.array([1.0, -1.0, -1.0])
"""Turns a point of the map (x right, y down, z ahead) into glTF's axes (y up, z towards who looks)."""
_FLOAT, _BYTE, _INT = 5126, 5121, 5125
"""glTF 2.0: types of a component."""
_VERTICES, _TRIANGLES = 34962, 34963
"""glTF 2.0: what a buffer holds."""
_JSON, _BIN = 0x4E4F534A, 0x004E4942
"""glTF 2.0: types of the chunks of a .glb file, their names in ASCII."""


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """`vertices` (n x 3, m, map) with `colors` (n x 3), and `triangles` (m x 3, numbers of vertices)."""

    vertices: Array
    colors: NDArray[np.uint8]
    triangles: NDArray[np.uint32]


def mesh_ply(mesh: TriangleMesh) -> bytes:
    """Return a binary PLY file of a mesh; one without triangles is a cloud of points."""
    rows = np.zeros(len(mesh.vertices), dtype=[("xyz", "<f4", 3), ("rgb", "u1", 3)])
    rows["xyz"], rows["rgb"] = mesh.vertices, mesh.colors
    faces = np.zeros(len(mesh.triangles), dtype=[("count", "u1"), ("corners", "<u4", 3)])
    faces["count"], faces["corners"] = 3, mesh.triangles
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(rows)}"]
    head += [f"property float {axis}" for axis in "xyz"]
    head += [f"property uchar {name}" for name in ("red", "green", "blue")]
    if len(faces):
        head += [f"element face {len(faces)}", "property list uchar uint vertex_indices"]
    return "\n".join([*head, "end_header", ""]).encode() + rows.tobytes() + faces.tobytes()


def glb(mesh: TriangleMesh) -> bytes:
    """Return a binary glTF file of a mesh with at least one triangle."""
    positions = (mesh.vertices * _GLTF_MAP).astype("<f4")
    colors = np.full((len(positions), 4), 255, dtype=np.uint8)
    colors[:, :3] = mesh.colors
    parts = [positions.tobytes(), colors.tobytes(), mesh.triangles.astype("<u4").tobytes()]
    starts = np.concatenate([[0], np.cumsum([len(part) for part in parts])]).tolist()
    views = [
        {"buffer": 0, "byteOffset": start, "byteLength": len(part), "target": target}
        for start, part, target in zip(starts, parts, (_VERTICES, _VERTICES, _TRIANGLES), strict=False)
    ]
    count = len(positions)
    bounds = {"min": positions.min(axis=0).tolist(), "max": positions.max(axis=0).tolist()}
    content = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "COLOR_0": 1}, "indices": 2}]}],
        "accessors": [
            {"bufferView": 0, "componentType": _FLOAT, "count": count, "type": "VEC3", **bounds},
            {"bufferView": 1, "componentType": _BYTE, "normalized": True, "count": count, "type": "VEC4"},
            {"bufferView": 2, "componentType": _INT, "count": mesh.triangles.size, "type": "SCALAR"},
        ],
        "bufferViews": views,
        "buffers": [{"byteLength": starts[-1]}],
    }
    chunks = _chunk(_JSON, json.dumps(content).encode(), b" ") + _chunk(_BIN, b"".join(parts), b"\0")
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def _chunk(kind: int, content: bytes, filler: bytes) -> bytes:
    padded = content + filler * (-len(content) % 4)
    return struct.pack("<II", len(padded), kind) + padded
