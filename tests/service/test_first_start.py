import os
import subprocess
import sys

import compiling
import pytest


def test_two_processes_share_the_compilation_of_a_first_start():
    """The whole suite's own first start, before its tests, where nothing had been compiled."""
    if compiling.FIRST_START not in os.environ:
        pytest.skip("what is judged is a start that compiles: all was compiled before, or this is not the whole suite")
    own_s, others_s, is_all = compiling.start_costs(os.environ[compiling.FIRST_START])
    again = subprocess.run([sys.executable, "-c", compiling.START], capture_output=True, text=True, check=True)
    own_again_s, others_again_s, is_all_again = compiling.start_costs(again.stdout)
    assert (is_all, is_all_again) == (False, True)  # what calibrates a run is not waited for
    assert max(own_s, others_s) < 0.7 * (own_s + others_s)
    assert own_again_s < 0.3 * own_s
    assert others_again_s == 0.0
