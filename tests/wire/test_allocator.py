"""A process that asks for it does not keep the memory of large things that are gone."""

import subprocess
import sys

import pytest

HOLES = """
import psutil
from odom.wire import allocator

{before}
bytes(16 << 20)  # as large as glibc's own threshold goes up to by this
filled = [b"z" * 5_000 for _ in range(4_000)]  # what imports have left free, or what stays would lie there
before = psutil.Process().memory_info().rss
large, stays = [], []
for size in range({smallest}, 3 * {smallest}, {smallest} // 100):
    large.append(b"x" * size)
    stays.append(b"y" * 5_000)
large.clear()
{after}
print((psutil.Process().memory_info().rss - before) / 1e6)
"""

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="glibc's settings")


def kept_mb(smallest: int, before: str = "", after: str = "") -> float:
    script = HOLES.format(smallest=smallest, before=before, after=after)
    return float(subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout)


def test_large_messages_leave_no_holes_behind() -> None:
    assert kept_mb(150_000) > 20.0
    assert kept_mb(150_000, before="allocator.give_back_large_blocks()") < 5.0


def test_what_is_larger_than_images_leaves_no_holes_in_a_process_that_keeps_little() -> None:
    assert kept_mb(2_200_000) > 100.0
    assert kept_mb(2_200_000, before="allocator.keep_little()") < 5.0


def test_holes_are_given_back_when_asked_for() -> None:
    assert kept_mb(150_000, after="allocator.give_back_freed()") < 5.0


CODE = """
import re
import numba
from pathlib import Path
from odom.wire import allocator

def compiler_mb():
    parts = re.split(r"^[0-9a-f]+-[0-9a-f]+ ", Path("/proc/self/smaps").read_text(), flags=re.MULTILINE)
    ours = [part for part in parts if part.startswith("r-xp") and "llvm" in part.splitlines()[0]]
    return sum(int(re.search(r"Rss: +([0-9]+)", part).group(1)) for part in ours) / 1e3

double = numba.njit(lambda a: 2 * a)
double(1.0)
before = compiler_mb()
allocator.give_back_code()
print(compiler_mb() / before, double(2.0), double(2))
"""


def test_code_that_is_given_back_is_there_when_it_is_called_again() -> None:
    done = subprocess.run([sys.executable, "-c", CODE], capture_output=True, text=True, check=True)
    left, *results = done.stdout.split()
    assert float(left) < 0.05
    assert results == ["4.0", "4"]
