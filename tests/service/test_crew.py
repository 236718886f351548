"""The order in which the processes of one run come and go, with children that only pretend."""

import json
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from odom.errors import OdomError
from odom.service.run import RunPlan, run
from odom.service.settings import Settings

Says = Callable[[str, str], None]


class PretendedChild:
    """Ends with status 0 when it is asked to."""

    peak_rss_mb, cpu_s = 1.0, 0.1

    def __init__(self, name: str, arguments: object, environment: object, say: Says) -> None:
        self.name = name
        self.status: int | None = None
        self.failed = False

    def poll(self) -> int | None:
        return self.status

    def wait(self, timeout_s: float) -> bool:
        return self.status is not None

    def stop(self, timeout_s: float) -> None:
        self.status = 0 if self.status is None else self.status


def test_a_run_stopped_at_once_does_not_pass_off_the_results_before_it_as_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("odom.service.run.Child", PretendedChild)
    (tmp_path / "report.json").write_text(json.dumps({"frames": 5}))
    (tmp_path / "notes.txt").write_text("mine")
    stop = threading.Event()
    stop.set()
    with pytest.raises(OdomError, match="stopped before the first"):
        run(RunPlan("arena", tmp_path), Settings(), stop)
    assert "frames" not in json.loads((tmp_path / "report.json").read_text())
    assert (tmp_path / "notes.txt").exists()
