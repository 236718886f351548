"""Colour and depth in one folder, told apart by a word of their names: 7-Scenes', BundleFusion's, and one's own."""

import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from odom.frame import Camera
from sensors.default_camera import first_size
from sensors.image_lists import FolderLayout
from sensors.image_names import COLOR_WORDS, DEPTH_WORDS, alike, by_stamp, images_in, visible
from sensors.intrinsic_files import camera_beside, sens_cameras
from sensors.kinds_of_names import of_one_camera
from sensors.true_poses import THE_CAMERAS_OWN, poses_in, poses_of_images

_WORD = re.compile(r"[a-z]+")
_SEVEN_SCENES = re.compile(r"frame-\d+\.color\.png\Z")
"""Names of 7-Scenes' colour images; a folder of such that says nothing of its camera is taken for one of 7-Scenes'."""
_SEVEN_SCENES_FOCAL = 585.0 / 640
"""Focal length of the depth camera that 7-Scenes publishes, in widths of the image, in whose middle its centre is. The
colour camera, an ordinary Kinect's, and how the two are mounted are not published."""
_KINECT_BASELINE_M = (-0.025, 0.0, 0.0)
"""Where a Kinect v1's depth camera is, seen from the colour camera: 2.5 cm to the left."""
_NO_DEPTH = 65535
"""Value of 7-Scenes' depth where nothing was measured; in millimetres, no depth camera's in any folder."""


def is_mixed_folder(path: Path) -> bool:
    """Whether a folder holds images of colour and of depth, which their numbered names tell."""
    color, depth = _told_apart(images_in(path))
    return bool(alike(color) and alike(depth))


def mixed_folder(path: Path) -> FolderLayout:
    """Return the images by the stamps or numbers in their names; depth is in millimetres.

    Files with `pose` in their names hold true poses, else they are found by `poses_of_images`. The camera is that of
    BundleFusion's `info.txt`, or of a file that `camera_beside` finds. Depth is registered, unless `info.txt` describes
    a depth camera of its own; 7-Scenes' images are raw, and its poses are depth's. Raises ConfigError where such a file
    holds something else.
    """
    color, depth = (by_stamp(path, files) for files in of_one_camera(*_told_apart(images_in(path))))
    size = first_size(path, color)
    camera, depth_camera, scale = sens_cameras(path / "info.txt")
    if camera is None and size is not None:
        camera = camera_beside(path, size)
    T_depth_color, position_m = THE_CAMERAS_OWN, (0.0, 0.0, 0.0)
    if camera is None and color and _SEVEN_SCENES.match(color[0].values[0]):
        T_depth_color, position_m = np.eye(4), _KINECT_BASELINE_M
        T_depth_color[:3, 3] = -np.array(_KINECT_BASELINE_M)
        depth_size = first_size(path, depth)
        depth_camera = None if depth_size is None else _seven_scenes_depth(*depth_size)
    poses = by_stamp(path, visible(path, "*pose*.txt"))
    return FolderLayout(
        f"{path.name}/",
        color,
        depth,
        poses_in(path, poses, T_depth_color) or poses_of_images(path, color),
        camera,
        scale,
        _NO_DEPTH,
        depth_camera=depth_camera,
        depth_position_m=position_m,
    )


def _told_apart(images: Iterable[Path]) -> tuple[list[Path], list[Path]]:
    """Return the images whose names have a word for colour, and for depth, unless all names have it.

    A name with both is depth's, as `aligned_depth_to_color_0001.png`.
    """
    words = {file: {word.removesuffix("s") for word in _WORD.findall(file.stem.lower())} for file in images}
    telling = set(DEPTH_WORDS) - (set.intersection(*words.values()) if words else set())
    depth = sorted(file for file, said in words.items() if not said.isdisjoint(telling))
    color = sorted(file for file in words.keys() - set(depth) if not words[file].isdisjoint(COLOR_WORDS))
    return color, depth


def _seven_scenes_depth(width: int, height: int) -> Camera:
    focal = _SEVEN_SCENES_FOCAL * width
    return Camera(width, height, focal, focal, width / 2, height / 2)
