"""Two sensors at once through one router, as in docker-compose.yml: its own commands, run here."""

import json
import time
from pathlib import Path

import pytest
import yaml
from rig import Process, free_port, processes

ROOT = Path(__file__).parents[2]


def poses(file: Path) -> int:
    return len(file.read_text().splitlines()) if file.exists() else 0


@pytest.mark.timeout(900)
def test_the_compose_files_commands_track_two_devices_at_once(tmp_path: Path) -> None:
    services = yaml.safe_load((ROOT / "docker-compose.yml").read_text())["services"]
    port = free_port()

    def command(service: str, namespace: str) -> list[str]:
        words = []
        for word in services[service]["command"]:
            word = word.replace("0.0.0.0:7447", f"127.0.0.1:{port}").replace("/opt/rgbd-odom", str(ROOT))
            words.append(word.replace("/data", str(tmp_path / namespace)))
        return words

    with processes() as started:
        router = Process("router", tmp_path / "router.log", command("router", "cam0"))
        started.append(router)
        router.wait_for("routing at", 60)
        for namespace in ("cam0", "cam1"):
            (tmp_path / namespace).mkdir()
            environment = dict(services["odometry"]["environment"])
            environment["ODOM_WIRE__CONNECT"] = json.dumps([f"tcp/127.0.0.1:{port}"])
            environment["ODOM_WIRE__NAMESPACE"] = namespace
            for service in ("odometry", "recorder", "sensor"):
                log = tmp_path / f"{service}-{namespace}.log"
                started.append(Process(service, log, command(service, namespace), **environment))
        deadline = time.monotonic() + 600
        sensors = [process for process in started if process.name == "sensor"]
        while any(process.popen.poll() is None for process in sensors):
            assert time.monotonic() < deadline, [process.said[-500:] for process in started]
            time.sleep(0.2)
        assert [process.popen.returncode for process in sensors] == [0, 0]
        for process in reversed(started):
            if process.popen.poll() is None:
                process.end(60)
    counts = [poses(tmp_path / namespace / "odometry" / "odometry.txt") for namespace in ("cam0", "cam1")]
    assert counts[0] == counts[1] > 200
    same = [(tmp_path / namespace / "odometry" / "odometry.txt").read_bytes() for namespace in ("cam0", "cam1")]
    assert same[0] == same[1]  # neither has heard a frame of the other's
    assert all(len(list((tmp_path / namespace).glob("session-*.mcap"))) == 1 for namespace in ("cam0", "cam1"))
