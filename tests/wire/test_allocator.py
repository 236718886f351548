"""A process that passes large messages on does not keep the memory of those that are gone."""

import subprocess
import sys

import pytest

HOLES = """
import psutil
from odom.wire.allocator import give_back_large_blocks

if {gives_back}:
    give_back_large_blocks()
bytes(8 << 20)  # as large as glibc's own threshold goes up to by this
before = psutil.Process().memory_info().rss
large, stays = [], []
for size in range(150_000, 450_000, 1_000):
    large.append(b"x" * size)
    stays.append(b"y" * 5_000)
large.clear()
print((psutil.Process().memory_info().rss - before) / 1e6)
"""


def kept_mb(gives_back: bool) -> float:
    script = HOLES.format(gives_back=gives_back)
    return float(subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout)


@pytest.mark.skipif(sys.platform != "linux", reason="glibc's setting")
def test_large_messages_leave_no_holes_behind():
    assert kept_mb(gives_back=False) > 20.0
    assert kept_mb(gives_back=True) < 5.0
