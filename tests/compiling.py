"""What most tests need compiled, compiled once, in several processes: two workers would each compile all of it."""

import subprocess
import sys

PRODUCT = """
from odom.backend import OdometrySettings
from odom.service.startup import warm_up
from odom.wire import Topics
warm_up(OdometrySettings(), Topics()).wait()
"""
ARENA = """
from sensors import arena
arena.frame(arena.ArenaOptions(), 0)
"""


def compile_all(*programs: str) -> None:
    """Run programs that compile, at the same time; what is compiled already they only load."""
    started = [subprocess.Popen([sys.executable, "-c", program]) for program in programs]
    statuses = [process.wait(580) for process in started]
    assert not any(statuses), f"compiling ended with status {statuses}"
