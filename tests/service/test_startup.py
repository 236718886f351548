import os
import subprocess
import sys
from pathlib import Path

PROGRAM = """
import sys
from odom.backend import OdometrySettings
from odom.service.startup import warm_up
from odom.wire import Topics

warm_up(OdometrySettings(), Topics())
loaded = set(sys.modules)
import odom.backend.map.pose_graph as graph
import numpy as np
edges = graph.EdgeArrays.of([graph.Edge(0, 1, np.eye(4), np.eye(6))])
graph.optimise(np.tile(np.eye(4), (2, 1, 1)), np.array([True, False]), edges)
print(sorted(set(sys.modules) - loaded))
"""


def test_a_closed_loop_imports_nothing_any_more():
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, timeout=300, check=True)
    assert done.stdout.strip() == "[]"


SEEN = """
import sys

def compiled():
    loops = (x for name in list(sys.modules) if name.startswith("odom.") for x in vars(sys.modules[name]).values())
    return {(x.py_func.__qualname__, s) for x in loops if hasattr(x, "signatures") for s in x.signatures}
"""

COMPILED = """
import numba
from dataclasses import replace
import numpy as np
from odom.backend import Odometry, OdometrySettings
from odom.registration import Pairs, register
from odom.service.startup import warm_up
from odom.wire import Topics
from drawn import frame
from sensors.arena import ArenaOptions

warm_up(OdometrySettings(), Topics())
before = compiled()
options = ArenaOptions()
odometry = Odometry(options.camera)
states, reasons = [], []
for i in [*range(45), *range(60, 75), *range(900, 945)]:
    shot = frame(options, i).rgbd()
    if 12 <= i < 30:
        shot = replace(shot, color=np.zeros_like(shot.color))
    if 21 <= i < 30:
        shot = replace(shot, depth_mm=np.zeros_like(shot.depth_mm))
    estimate = odometry.process(shot)
    states.append(estimate.state.name)
    reasons.append(estimate.reason)
odometry.finish()
odometry.closing_test()
aside = Odometry(options.camera)
for shot in (frame(options, i).rgbd() for i in range(4)):
    aside.process(replace(shot, depth_mm=np.where(np.arange(640) < 180, shot.depth_mm, 0).astype(np.uint16)))
assert aside.map.landmarks.assumed.any()
rng = np.random.default_rng(3)
points, small = rng.uniform(-1.0, 1.0, (40, 3)), np.tile(1e-6 * np.eye(3), (40, 1, 1))
register(Pairs(points, rng.permuted(points), small, small))  # a place that only looks alike
assert "RECOVERED" in states and "LOST" in states, states
assert any("surfaces" in reason for reason in reasons), reasons
assert before
print(sorted(compiled() - before))
"""

IN_A_MAP = """
import sys, tempfile
from contextlib import closing
from pathlib import Path
from odom.backend import Odometry, OdometrySettings
from odom.map_file.map_file import MapFile
from odom.service.startup import warm_up
from odom.wire import Topics
from drawn import frame
from sensors.arena import ArenaOptions

warm_up(OdometrySettings(), Topics()).wait()
before, options, late = compiled(), ArenaOptions(), {}
with tempfile.TemporaryDirectory() as folder:
    for session, is_written in [("made", True), ("gone on with", True), ("once more", True), ("localised", False)]:
        with closing(MapFile(Path(folder) / "room.map", is_written)) as room:
            odometry = Odometry(options.camera, saved=room.begin(options.camera))
            states = []
            for i in range(45):
                states.append(odometry.process(frame(options, i).rgbd()).state.name)
                room.put(odometry.take_map_changes())
            odometry.finish()
            room.put(odometry.take_map_changes())
        assert (session != "made") == ("RECOVERED" in states), (session, states)
        new = compiled() - before
        if new:
            late[session] = sorted({name for name, _ in new})
        before |= new
print(late)
"""


SOURCES = """
import sys
import numpy as np
from odom.backend import Odometry, OdometrySettings
from odom.frame import Camera, RgbdFrame, Stamp
from odom.service.startup import warm_up
from odom.wire import Topics, codec
from odom.wire.codec import cdr
from odom.wire.codec.image_messages import _COLOR_ENCODINGS
from drawn import frame
from sensors.arena import ArenaOptions

warm_up(OdometrySettings(), Topics())
before, loaded = compiled(), set(sys.modules)
options = ArenaOptions()
shots = [frame(options, i).rgbd() for i in range(4)]

def image(topic, stamp, pixels, encoding, padding=0, is_bigendian=0):
    rows = np.ascontiguousarray(pixels).reshape(len(pixels), -1).view(np.uint8)
    rows = np.pad(rows, ((0, 0), (0, padding)))
    size = {"height": pixels.shape[0], "width": pixels.shape[1], "step": rows.shape[1]}
    return cdr.encode(topic, cdr.IMAGE, stamp, "camera", encoding=encoding, is_bigendian=is_bigendian,
                      data=rows.ravel(), **size)

def color_as(encoding, shot, padding):
    grey = shot.color.mean(axis=2).astype(np.uint8)
    if encoding == "mono16":
        return image("c", shot.stamp, grey.astype("<u2") * 257, encoding, padding)
    channels = _COLOR_ENCODINGS[encoding][0]
    pixels = grey if channels == 1 else np.repeat(grey[..., None], channels, axis=2)
    return image("c", shot.stamp, pixels, encoding, padding)

colors = {f"{name} {padding}": lambda shot, n=name, p=padding: color_as(n, shot, p)
          for name in [*_COLOR_ENCODINGS, "mono16"] for padding in (0, 8)}
colors["jpeg"] = lambda shot: codec.encode_color_jpeg("c", shot.stamp, shot.color)
depths = {
    "16UC1": lambda shot: image("d", shot.stamp, shot.depth_mm, "16UC1"),
    "padded": lambda shot: image("d", shot.stamp, shot.depth_mm, "mono16", 8),
    "big": lambda shot: image("d", shot.stamp, shot.depth_mm.astype(">u2"), "16UC1", 0, 1),
    "32FC1": lambda shot: image("d", shot.stamp, (shot.depth_mm * 1e-3).astype("<f4"), "32FC1"),
    "png": lambda shot: codec.encode_depth_compressed("d", shot.stamp, shot.depth_mm, codec="png"),
    "rvl": lambda shot: codec.encode_depth_compressed("d", shot.stamp, shot.depth_mm, codec="rvl"),
}
lenses = [(), (0.1, -0.05, 1e-3, 1e-3), (0.1, -0.05, 1e-3, 1e-3, 0.01), (0.1, -0.05, 1e-3, 1e-3, 0.01, 0.1, 0.0, 0.0),
          (0.1, -0.05, 1e-3, 1e-3, 0.01, 0.1, *[0.0] * 6), (0.1, -0.05, 1e-3, 1e-3, 0.01, 0.1, *[0.0] * 8)]
plain = options.camera
kinds = [(make, depths["16UC1"], ()) for make in colors.values()]
kinds += [(colors["rgb8 0"], make, ()) for make in depths.values()]
kinds += [(colors["bgr8 0"], depths["16UC1"], lens) for lens in lenses]
late = {}
for number, (color, depth, lens) in enumerate(kinds):
    odometry = Odometry(Camera(plain.width, plain.height, plain.fx, plain.fy, plain.cx, plain.cy, lens))
    for grey in (True, False):
        for shot in shots:
            stamp = Stamp(shot.stamp + 10**9 * (not grey))
            seen = codec.decode_color(color(shot), grey=grey)
            odometry.process(RgbdFrame(shot.sequence, stamp, seen, stamp, codec.decode_depth(depth(shot))))
    new = compiled() - before
    if new:
        late[number] = sorted({name for name, _ in new})
    before |= new
shot = shots[0]  # and from Python, where images may be written, upside down, or every second pixel of larger ones
odometry = Odometry(plain)
for i, (color, depth) in enumerate([(shot.color, shot.depth_mm), (shot.color[::-1], shot.depth_mm[::-1]),
                                    (np.repeat(np.repeat(shot.color, 2, 0), 2, 1)[::2, ::2, 0],
                                     np.repeat(np.repeat(shot.depth_mm, 2, 0), 2, 1)[::2, ::2])]):
    odometry.process(RgbdFrame(i, Stamp(i * 33_333_333), color, Stamp(i * 33_333_333), depth))
late |= {"python": sorted({name for name, _ in compiled() - before})} if compiled() - before else {}
print(late, sorted(name for name in set(sys.modules) - loaded if name.startswith("odom")))
"""


def run(program: str) -> str:
    helpers = os.pathsep.join([str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH", "")])
    command, env = [sys.executable, "-c", SEEN + program], {**os.environ, "PYTHONPATH": helpers}
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, env=env)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_nothing_is_compiled_in_the_midst_of_a_walk():
    assert run(COMPILED) == "[]"


def test_nothing_is_compiled_while_a_camera_is_looked_for_in_a_map():
    """Its first pose would be followed by a stall of a second and more."""
    assert run(IN_A_MAP) == "{}"


def test_nothing_is_compiled_or_imported_late_whatever_images_and_lens_a_source_has():
    """A second of compiling costs a live source 30 frames."""
    assert run(SOURCES) == "{} []"
