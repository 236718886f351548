"""The picture of a mesh for the README: `python tests/export/mesh_picture.py MESH.ply OUT.png`.

Rays are cast by Open3D without a screen. The view is from behind and above the first camera; walls that would hide the
room are seen through from their backs.
"""

import sys
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

WIDTH, HEIGHT, FIELD_DEG = 1200, 600, 62.0
EYE, LOOK_AT, UP = (-0.6, -3.6, -5.2), (0.1, 0.6, 1.0), (0.0, 1.0, 0.0)
"""In the first camera's axes, metres: x right, y down, z forward. The picture's columns run along `UP`."""
BACKGROUND = 246
MOST_LAYERS = 6
"""Surfaces seen from behind that a ray passes before it ends."""


def picture(mesh_file: Path) -> NDArray[np.uint8]:
    import open3d

    mesh = open3d.t.io.read_triangle_mesh(str(mesh_file))
    triangles = mesh.triangle.indices.numpy()
    colors = mesh.vertex.colors.numpy().astype(np.float64)
    colors = colors / 255 if colors.max() > 1 else colors
    scene = open3d.t.geometry.RaycastingScene()
    scene.add_triangles(mesh)
    rays = scene.create_rays_pinhole(FIELD_DEG, list(LOOK_AT), list(EYE), list(UP), WIDTH, HEIGHT).numpy()
    rays[..., 3:] /= np.linalg.norm(rays[..., 3:], axis=-1, keepdims=True)
    image = np.full((HEIGHT, WIDTH, 3), BACKGROUND / 255)
    waiting = np.ones((HEIGHT, WIDTH), dtype=bool)
    for _ in range(MOST_LAYERS):
        hit = scene.cast_rays(open3d.core.Tensor(rays))
        distance, normals = hit["t_hit"].numpy(), hit["primitive_normals"].numpy()
        facing = -(normals * rays[..., 3:]).sum(axis=-1)
        is_seen = waiting & np.isfinite(distance) & (facing > 0)
        corners = triangles[hit["primitive_ids"].numpy()[is_seen]]
        u, v = hit["primitive_uvs"].numpy()[is_seen].T[..., None]
        color = (1 - u - v) * colors[corners[:, 0]] + u * colors[corners[:, 1]] + v * colors[corners[:, 2]]
        image[is_seen] = color * (0.72 + 0.28 * facing[is_seen, None])
        waiting &= np.isfinite(distance) & ~is_seen
        step = np.where(waiting, distance + 1e-3, 0.0)
        rays[..., :3] += np.nan_to_num(step, posinf=0.0)[..., None] * rays[..., 3:]
    return np.clip(image * 255, 0, 255).astype(np.uint8)


def main(mesh: str, out: str) -> None:
    cv2.imwrite(out, cv2.cvtColor(picture(Path(mesh)), cv2.COLOR_RGB2BGR), [cv2.IMWRITE_PNG_COMPRESSION, 9])


if __name__ == "__main__":
    main(*sys.argv[1:])
