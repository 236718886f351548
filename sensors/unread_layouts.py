"""Folders of other tools that are known but not read: what each is, and what to convert."""

from collections.abc import Callable
from pathlib import Path

from odom.wire.recording.bag_folder import UNPACK_FIRST, is_packed
from sensors.image_names import visible

_NUMPY = ".npy"


def unread_layout(path: Path) -> str | None:
    """Return in a sentence what a file or folder is and what to convert, None of what is not known."""
    return next((f"{path} {says}" for _is, says in _KNOWN if _is(path)), None) or _numpys_depth(path)


def _is_record3d(path: Path) -> bool:
    return path.suffix.lower() == ".r3d" or any(visible(path / "rgbd", "*.depth"))


_KNOWN: tuple[tuple[Callable[[Path], bool], str], ...] = (
    (
        lambda path: (path / "rgb.mp4").is_file() and (path / "depth").is_dir(),
        "is StrayScanner's, whose colour is a video: write its frames as images with the numbers of depth/ (mkdir rgb; "
        "ffmpeg -i rgb.mp4 -fps_mode passthrough -start_number 0 -q:v 2 rgb/%06d.jpg), and the numbers of "
        "camera_matrix.csv as camera.yaml",
    ),
    (
        lambda path: any(visible(path, "r-*.ppm")) and any(visible(path, "d-*.pgm")),
        "is a raw scene of NYU Depth V2, whose depth images hold a Kinect's disparities, not registered to colour: "
        "convert them with the data set's toolbox, and write rgb/STAMP.png, and depth/STAMP.png with millimetres in "
        "16 bits, beside each other",
    ),
    (
        _is_record3d,
        "is Record3D's, whose depth is compressed by Apple's LZFSE: convert it, and write rgb/NUMBER.jpg, and "
        "depth/NUMBER.png with millimetres in 16 bits (or depth/NUMBER.npy with metres), beside each other, "
        "with K of its metadata as camera.yaml",
    ),
    (lambda path: any(map(is_packed, (path, *visible(path)))), UNPACK_FIRST),
)


def _numpys_depth(path: Path) -> str | None:
    """Return what is said of depth in numpy's files without colour that could be told from it."""
    folders = (folder for folder in sorted(visible(path)) if "depth" in folder.name.lower() and folder.is_dir())
    found = next((folder for folder in folders if any(visible(folder, f"*{_NUMPY}"))), None)
    if found is None:
        return None
    return (
        f"{path} holds depth in numpy's files ({found.name}/), and no colour that is known to belong to it: call the "
        "folder of colour color/ and that of depth depth/, with the same numbers or stamps in the names of both"
    )
