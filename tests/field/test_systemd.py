"""The systemd units: their commands are understood, systemd finds no fault, and readiness is told."""

import os
import shlex
import shutil
import signal
import socket
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import typer

from odom.cli import app
from odom.service.settings import ServiceSettings, load_settings

README = Path(__file__).parents[2] / "README.md"
UNITS = sorted((Path(__file__).parents[2] / "odom" / "service" / "systemd").glob("*.service"))
PROGRAM = "/opt/odom/bin/odom"


def lines_of(unit: Path) -> dict[str, str]:
    return dict(line.split("=", 1) for line in unit.read_text().splitlines() if "=" in line and line[0] not in "#[")


@pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.name)
def test_the_command_of_each_unit_is_understood(unit: Path) -> None:
    command = lines_of(unit)["ExecStart"].replace("$SOURCE", "kinect").replace("%i", "cam0")
    program, name, *arguments = shlex.split(command)
    group: Any = typer.main.get_command(app)
    assert program == PROGRAM
    assert group.commands[name].make_context(name, arguments) is not None


@pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.name)
def test_systemd_finds_no_fault(unit: Path, tmp_path: Path) -> None:
    if shutil.which("systemd-analyze") is None:
        pytest.skip("needs systemd-analyze: apt install systemd")
    instance = tmp_path / unit.name.replace("@", "@cam0")
    instance.write_text(unit.read_text().replace(PROGRAM, "/bin/true"))
    checked = subprocess.run(["systemd-analyze", "verify", instance], capture_output=True, text=True)
    assert not [line for line in checked.stderr.splitlines() if unit.stem in line]
    assert checked.returncode == 0


def test_units_restart_for_ever_and_are_bounded() -> None:
    assert len(UNITS) == 4
    for unit in UNITS:
        lines = lines_of(unit)
        assert lines["Restart"] == "always"
        assert lines["StartLimitIntervalSec"] == "0"
        assert "MemoryMax" in lines


def test_each_unit_compiles_into_a_cache_of_its_own() -> None:
    caches = [lines["CacheDirectory"] for lines in map(lines_of, UNITS) if "CacheDirectory" in lines]
    environments = [lines["Environment"] for lines in map(lines_of, UNITS) if "NUMBA" in lines["Environment"]]
    assert len(caches) == len(environments) == 2
    for cache, environment in zip(caches, environments, strict=True):
        assert "%p-%i" in cache
        assert f"NUMBA_CACHE_DIR=/var/cache/{cache}" in environment.split()


def test_the_odometry_may_take_as_long_to_save_as_elsewhere() -> None:
    (unit,) = [lines_of(unit) for unit in UNITS if unit.name.startswith("odom-serve")]
    assert float(unit["TimeoutStopSec"]) >= ServiceSettings().stop_timeout_s


def examples() -> dict[str, dict[str, str]]:
    """The README's files of settings for the units, by name."""
    block = README.read_text().split("## As a service")[1].split("\n## ")[0]
    files: dict[str, dict[str, str]] = {}
    for line in block.splitlines():
        if line.startswith("    # /etc/odom/"):
            name = line.split()[1].removeprefix("/etc/odom/")
            files[name] = {}
        elif line.startswith("    ") and "=" in line and files:
            variable, value = line.strip().split("=", 1)
            (files[name][variable],) = shlex.split(value)
    return files


def test_the_readmes_files_of_settings_are_understood(monkeypatch: pytest.MonkeyPatch) -> None:
    files = examples()
    assert files.keys() == {"router.env", "odom.env", "sensor-cam0.env", "serve-cam0.env", "record-cam0.env"}
    for name, variables in files.items():
        is_router = name == "router.env"
        with monkeypatch.context() as environment:
            for variable, value in (variables if is_router else files["odom.env"] | variables).items():
                environment.setenv(variable, value)
            wire = load_settings().wire  # raises when a variable is unknown
        assert all(where.startswith("tls/") for where in (wire.listen if is_router else wire.connect))
        assert name == "odom.env" or wire.security.tls
        assert is_router or wire.mode == "client"


@pytest.mark.timeout(400)
def test_readiness_and_stopping_are_told(tmp_path: Path) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        address = tmp_path / "notify"
        manager.bind(str(address))
        manager.settimeout(300)
        command = [sys.executable, "-m", "odom", "serve", "--listen", "tcp/127.0.0.1:0", "--connect", "tcp/127.0.0.1:9"]
        with subprocess.Popen(
            command, env=os.environ | {"NOTIFY_SOCKET": str(address)}, stderr=subprocess.DEVNULL
        ) as process:
            assert manager.recv(100) == b"READY=1"
            process.send_signal(signal.SIGTERM)
            assert manager.recv(100) == b"STOPPING=1"
            assert process.wait(60) == 0
