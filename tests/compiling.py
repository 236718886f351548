"""What most tests need compiled, compiled once, in several processes: two workers would each compile all of it."""

import subprocess
import sys

FIRST_START = "ODOM_TEST_FIRST_START"
"""Variable with what this session's first start printed; unset where nothing had to be compiled."""

START = """
import threading, time
import psutil
from odom.backend import OdometrySettings
from odom.service.startup import warm_up
from odom.wire import Topics

others = {}

def look():
    while True:
        for child in psutil.Process().children():
            try:
                others[child.pid] = sum(child.cpu_times()[:2])
            except psutil.Error:
                continue
        time.sleep(0.1)

if __name__ == "__main__":  # and not in the processes that compile
    threading.Thread(target=look, daemon=True).start()
    calibration_ready = warm_up(OdometrySettings(), Topics())
    own, is_all = time.process_time(), calibration_ready.is_set()
    calibration_ready.wait()
    print(own, int(is_all), *others.values())
"""
ARENA = """
from sensors import arena
arena.frame(arena.ArenaOptions(), 0)
"""


def compile_all(*programs: str) -> list[str]:
    """Run programs that compile, at the same time, and return what each printed; what is compiled they only load."""
    started = [subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE) for program in programs]
    printed = [process.communicate(timeout=580)[0].decode() for process in started]
    statuses = [process.returncode for process in started]
    assert not any(statuses), f"compiling ended with status {statuses}"
    return printed


def start_costs(printed: str) -> tuple[float, list[float], bool]:
    """Return a start's seconds of CPU until it was ready, those of its other processes, and whether all was ready."""
    own_s, is_all, *others_s = map(float, printed.split())
    return own_s, others_s, bool(is_all)
