"""What is looked at is nobody else's business: Rerun's collection of usage data is off."""

import subprocess
import time
from pathlib import Path

import psutil
import pytest

from odom.viewer import outputs
from odom.viewer.outputs import Outputs, open_outputs
from odom.viewer.rerun_program import program
from odom.viewer.settings import ViewerSettings


def test_a_served_page_collects_no_usage_data_and_leaves_the_users_settings_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("CI", "XDG_CONFIG_HOME", "XDG_DATA_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", str(tmp_path))
    port = outputs.free_port("127.0.0.1", 0)
    with open_outputs(Outputs(web=True), ViewerSettings(host="127.0.0.1", web_port=port), "cam0"):
        deadline = time.monotonic() + 30.0
        while not any(c.laddr.port == port for c in psutil.net_connections("tcp")) and time.monotonic() < deadline:
            time.sleep(0.05)
        (child,) = (each for each in psutil.Process().children() if each.name() == "rerun")
        asked = subprocess.run(
            [program(), "analytics", "config"],
            env=child.environ(), capture_output=True, text=True, timeout=30, check=True,
        )  # fmt: skip
    assert '"analytics_enabled": false' in asked.stdout.replace('":false', '": false'), asked.stdout
    assert not list(tmp_path.rglob("*analytics*"))
