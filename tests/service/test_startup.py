import subprocess
import sys

PROGRAM = """
import sys
from odom.backend import OdometrySettings
from odom.service.startup import warm_up
from odom.wire import Topics

warm_up(OdometrySettings(), Topics())
loaded = set(sys.modules)
import odom.backend.graph as graph
import numpy as np
graph.optimise({0: np.eye(4), 1: np.eye(4)}, 0, [graph.Edge(0, 1, np.eye(4), np.eye(6))])
print(sorted(set(sys.modules) - loaded))
"""


def test_a_closed_loop_imports_nothing_any_more():
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, timeout=300, check=True)
    assert done.stdout.strip() == "[]"
