"""nerfstudio's transforms.json: images, each with its pose and depth image.

Format: https://docs.nerf.studio/quickstart/data_conventions.html. Its cameras look along -z with y up (OpenGL), its
pixels have their centres at half numbers.
"""

from collections.abc import Iterable

import numpy as np

from odom.frame import Camera
from odom.geometry.arrays import Array

_OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])
"""Turns a camera with y down and z ahead into one of OpenGL, with y up and z behind."""
_MILLIMETRES = 0.001
"""Metres in a unit of the depth images."""


def transforms(camera: Camera, images: Iterable[tuple[str, Array]]) -> dict[str, object]:
    """Return the content of transforms.json for the names and poses T_map_camera (4 x 4) of images.

    Images are `images/NAME.jpg`, their depths in millimetres `depth/NAME.png`, points `points.ply`.
    """
    k = [*camera.distortion, *(0.0,) * 5]
    return {
        "camera_model": "OPENCV",
        "w": camera.width,
        "h": camera.height,
        "fl_x": camera.fx,
        "fl_y": camera.fy,
        "cx": camera.cx + 0.5,
        "cy": camera.cy + 0.5,
        "k1": k[0],
        "k2": k[1],
        "p1": k[2],
        "p2": k[3],
        "k3": k[4],
        "depth_unit_scale_factor": _MILLIMETRES,
        "ply_file_path": "points.ply",
        "frames": [
            {
                "file_path": f"images/{name}.jpg",
                "depth_file_path": f"depth/{name}.png",
                "transform_matrix": (T @ _OPENGL).tolist(),
            }
            for name, T in images
        ],
    }
