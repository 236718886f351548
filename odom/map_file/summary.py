"""What a map holds, in words and as files for other programs."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from odom.backend.map.saved import SavedKeyframe
from odom.errors import writing_whole
from odom.frame import seconds_text
from odom.geometry import se3
from odom.geometry.arrays import Array
from odom.geometry.quaternion import quaternion_from_rotation
from odom.map_file.map_file import MapFile

_PLY = """ply
format binary_little_endian 1.0
element vertex {}
property float x
property float y
property float z
end_header
"""


def lines_of(opened: MapFile) -> Iterator[str]:
    """Yield the lines of `odom map info`."""
    keyframes, edges = opened.keyframes(), opened.edges()
    size = opened.path.stat().st_size
    each = f", {size / len(keyframes) / 1e6:.2f} MB each" if keyframes else ""
    yield f"{opened.path}: {len(keyframes)} key frames, {size / 1e6:.1f} MB{each}"
    for session in opened.sessions():
        mine = [k for k in keyframes if k.session == session.number]
        camera = session.camera
        seconds = (mine[-1].stamp - mine[0].stamp) * 1e-9 if mine else 0.0
        yield (
            f"  session {session.number}: begun {session.begun}, {len(mine)} key frames in {seconds:.1f} s, "
            f"{camera.width} x {camera.height}, fx {camera.fx:.1f} fy {camera.fy:.1f}"
        )
    for segment in sorted({k.segment for k in keyframes}):
        mine = [k for k in keyframes if k.segment == segment]
        places = np.array([_T_map_keyframe(k)[:3, 3] for k in mine])
        extent = " x ".join(f"{side:.1f}" for side in np.ptp(places, axis=0))
        sessions = ", ".join(str(n) for n in sorted({k.session for k in mine}))
        yield f"  part {segment}: {len(mine)} key frames of session {sessions}, cameras within {extent} m"
    yield f"  {len(edges)} registrations, {sum(e.is_loop for e in edges)} of them close loops"


def write_files(opened: MapFile, folder: Path) -> Iterator[Path]:
    """Write session-N.txt and landmarks.ply, and yield their paths; raises OdomError when they cannot be written."""
    keyframes = opened.keyframes()
    for session in opened.sessions():
        path, segment, lines = folder / f"session-{session.number}.txt", None, []
        for k in (k for k in keyframes if k.session == session.number):
            lines += [] if k.segment == segment else [f"# segment {k.segment}\n"]
            segment = k.segment
            T = _T_map_keyframe(k) @ k.T_middle_stamp
            values = (*T[:3, 3], *quaternion_from_rotation(T[:3, :3]))
            lines.append(f"{seconds_text(k.stamp)} " + " ".join(f"{value:.9f}" for value in values) + "\n")
        with writing_whole(path) as part:
            part.write_text("".join(lines))
        yield path
    points = [se3.apply(_T_map_keyframe(k), d.landmarks.position) for k in keyframes if (d := opened.fetch(k.number))]
    cloud = np.concatenate([np.zeros((0, 3)), *points]).astype("<f4")
    path = folder / "landmarks.ply"
    with writing_whole(path) as part:
        part.write_bytes(_PLY.format(len(cloud)).encode() + cloud.tobytes())
    yield path


def _T_map_keyframe(keyframe: SavedKeyframe) -> Array:
    return se3.inverse(keyframe.T_camera_map)
