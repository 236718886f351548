"""Hosts as network namespaces, joined by a link with delay, rate and loss."""

import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

ADDRESSES = ("10.77.0.1", "10.77.0.2")


@dataclass(frozen=True)
class LinkQuality:
    """One way delay in ms, rate in Mbit/s, loss of packets in percent, and the hosts' TCP congestion control.

    Cubic, Linux's default, takes lost packets for a full link; BBR does not, but lets four packets a round trip pass
    for .2 s in every 10 s.
    """

    delay_ms: float = 1.0
    rate_mbit: float = 1000.0
    loss_percent: float = 0.0
    congestion: str = "cubic"


class Hosts:
    """Two hosts; `on(0)` is the prefix of a command on the first."""

    def __init__(self, names: tuple[str, str], cut_file: Path) -> None:
        self._names, self._cut_file = names, cut_file

    def on(self, host: int) -> list[str]:
        return ["ip", "netns", "exec", self._names[host]]

    def cut(self) -> None:
        self._cut_file.touch()

    def mend(self) -> None:
        self._cut_file.unlink()


def compile_link(folder: Path) -> Path:
    """Build the link, or skip with the reason."""
    compiler = shutil.which("g++")
    if os.geteuid() != 0 or not Path("/dev/net/tun").exists() or not shutil.which("ip") or not compiler:
        pytest.skip("needs root, /dev/net/tun, g++ and iproute2: network namespaces stand for the hosts")
    if subprocess.run(["ip", "netns", "add", "odom-try"], capture_output=True).returncode:
        pytest.skip("network namespaces are not permitted here")
    subprocess.run(["ip", "netns", "del", "odom-try"], check=True)
    program = folder / "link"
    source = Path(__file__).parent / "link.cpp"
    subprocess.run([compiler, "-std=c++17", "-O2", "-Wall", "-Wextra", "-pthread", source, "-o", program], check=True)
    return program


@contextmanager
def two_hosts(program: Path, quality: LinkQuality, folder: Path) -> Iterator[Hosts]:
    """Two namespaces with loopback and the link between them; gone at the end."""
    if quality.congestion not in Path("/proc/sys/net/ipv4/tcp_available_congestion_control").read_text().split():
        pytest.skip(f"this kernel has no {quality.congestion} congestion control: modprobe tcp_{quality.congestion}")
    tag = f"{os.getpid() % 10000}"
    names, interfaces = (f"odom-a{tag}", f"odom-b{tag}"), (f"tuna{tag}", f"tunb{tag}")
    cut_file = folder / "cut"
    figures = [str(quality.delay_ms), str(quality.rate_mbit), str(quality.loss_percent)]
    carrier = subprocess.Popen([program, *interfaces, *figures, cut_file], stdout=subprocess.PIPE, text=True)
    try:
        assert carrier.stdout is not None
        assert carrier.stdout.readline().strip() == "ready"
        for name, interface, address in zip(names, interfaces, ADDRESSES, strict=True):
            peer = ADDRESSES[1 - ADDRESSES.index(address)]
            for command in (
                ["netns", "add", name],
                ["link", "set", interface, "netns", name],
                ["-n", name, "link", "set", "lo", "up"],
                ["-n", name, "addr", "add", address, "peer", peer, "dev", interface],
                ["-n", name, "link", "set", interface, "up"],
                ["-n", name, "route", "replace", peer, "dev", interface, "congctl", quality.congestion],
            ):
                subprocess.run(["ip", *command], check=True)
        yield Hosts(names, cut_file)
    finally:
        carrier.kill()
        carrier.wait()
        for name in names:
            subprocess.run(["ip", "netns", "del", name], check=False)
