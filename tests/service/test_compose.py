"""The container files say what the commands understand: no Docker is needed to see that."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import typer
import yaml

from odom.cli import app
from odom.wire import WireSettings

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def services() -> dict[str, Any]:
    return dict(yaml.safe_load((ROOT / "docker-compose.yml").read_text())["services"])


def test_every_command_of_the_compose_file_is_understood(services: dict[str, Any]) -> None:
    group: Any = typer.main.get_command(app)
    checked = 0
    for name, service in services.items():
        if service.get("image") != "rgbd-odom":
            continue
        command, *arguments = service["command"]
        context = group.commands[command].make_context(command, list(arguments))
        assert context.params, name
        checked += 1
    assert checked == 6


def test_the_environment_of_the_compose_file_is_accepted_as_settings(services: dict[str, Any]) -> None:
    for service in services.values():
        environment = service.get("environment", {})
        given = {
            name.removeprefix("ODOM_WIRE__").lower(): json.loads(value) if value.startswith("[") else value
            for name, value in environment.items()
            if name.startswith("ODOM_WIRE__")
        }
        assert WireSettings(**given).mode in ("peer", "client")


def test_replay_is_the_default_and_the_kinect_gets_its_device(services: dict[str, Any]) -> None:
    assert (ROOT / ".env").read_text().split() == ["COMPOSE_PROFILES=replay"]
    assert services["sensor"]["profiles"] == ["replay"]
    assert services["kinect"]["profiles"] == ["kinect"]
    assert any("/dev/bus/usb" in device for device in services["kinect"]["devices"])
    assert {"router", "odometry", "recorder", "viewer"} == {n for n, s in services.items() if "profiles" not in s}


def test_the_recorder_which_ends_with_its_source_is_there_for_the_next(services: dict[str, Any]) -> None:
    assert services["recorder"]["restart"] == "unless-stopped"


def test_nothing_is_published_beyond_this_machine(services: dict[str, Any]) -> None:
    ports = [port for service in services.values() for port in service.get("ports", [])]
    assert ports
    assert all(port.startswith("127.0.0.1:") for port in ports)


def test_the_replayed_recording_is_in_the_repository(services: dict[str, Any]) -> None:
    recording = services["sensor"]["command"][1].removeprefix("/opt/rgbd-odom/")
    if not list((ROOT / "recordings").glob("*.mcap")):
        pytest.skip("no recording is in the repository yet")
    assert (ROOT / recording).is_file()


def test_the_image_copies_what_there_is() -> None:
    for line in (ROOT / "Dockerfile").read_text().splitlines():
        if line.startswith("COPY "):
            for source in line.split()[1:-1]:
                assert (ROOT / source).exists(), source


@pytest.mark.long
@pytest.mark.timeout(600)
def test_the_image_holds_all_that_is_compiled(tmp_path: Path) -> None:
    """Otherwise every container would compile again what its first start needs."""
    lines = (ROOT / "Dockerfile").read_text().replace("\\\n", " ").splitlines()
    (compiling,) = (line.removeprefix("RUN ") for line in lines if line.startswith("RUN ") and "warm_up" in line)
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    environment = {**os.environ, "PATH": path, "PYTHONPATH": str(ROOT), "NUMBA_CACHE_DIR": str(tmp_path)}
    subprocess.run(compiling, shell=True, check=True, timeout=580, env=environment)
    asked = "from odom.geometry.compiled import compiled_before; print(compiled_before())"
    done = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, check=True, env=environment)
    assert done.stdout.strip() == "True"
