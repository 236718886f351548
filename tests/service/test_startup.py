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
graph.optimise({0: np.eye(4), 1: np.eye(4)}, 0, [graph.Edge(0, 1, np.eye(4), np.eye(6))])
print(sorted(set(sys.modules) - loaded))
"""


def test_a_closed_loop_imports_nothing_any_more():
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, timeout=300, check=True)
    assert done.stdout.strip() == "[]"


COMPILED = """
import sys
import numba
from dataclasses import replace
import numpy as np
from odom.backend import Odometry, OdometrySettings
from odom.registration import Pairs, register
from odom.service.startup import warm_up
from odom.wire import Topics
from drawn import frame
from sensors.arena import ArenaOptions

def compiled():
    loops = (x for name in list(sys.modules) if name.startswith("odom.") for x in vars(sys.modules[name]).values())
    return {(x.py_func.__qualname__, s) for x in loops if hasattr(x, "signatures") for s in x.signatures}

warm_up(OdometrySettings(), Topics())
before = compiled()
options = ArenaOptions.from_texts({"seconds": "32"})
odometry = Odometry(options.camera)
states = []
for i in [*range(45), *range(60, 75), *range(900, 945)]:
    shot = frame(options, i).rgbd()
    if 20 <= i < 30:
        shot = replace(shot, color=np.zeros_like(shot.color))
    shot.depth_mm.flags.writeable = False  # as it is when it came over the wire
    states.append(odometry.process(shot).state.name)
odometry.finish()
odometry.closing_test()
rng = np.random.default_rng(3)
points, small = rng.uniform(-1.0, 1.0, (40, 3)), np.tile(1e-6 * np.eye(3), (40, 1, 1))
register(Pairs(points, rng.permuted(points), small, small))  # a place that only looks alike
assert "RECOVERED" in states and "LOST" in states, states
assert before
print(sorted(compiled() - before))
"""


def test_nothing_is_compiled_in_the_midst_of_a_walk():
    helpers = os.pathsep.join([str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH", "")])
    command, env = [sys.executable, "-c", COMPILED], {**os.environ, "PYTHONPATH": helpers}
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=True, env=env)
    assert done.stdout.strip() == "[]"
