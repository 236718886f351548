"""A small NatNet server, written from the protocol's description: streams rigid bodies over unicast or multicast UDP.

Its clock has its own frequency, origin and drift; a frame is stamped with the middle of its exposure, where that is of
`times_known` (exposure, receipt, sending), and sent later.
"""

import socket
import struct
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field

Pose = tuple[tuple[float, float, float], tuple[float, float, float, float]]


@dataclass
class NatNetServer:
    """Serve `bodies` (name to pose at host time in seconds) at `rate` Hz; a context manager."""

    bodies: dict[str, Callable[[float], Pose | None]]
    version: tuple[int, int] = (4, 1)
    multicast: str | None = None
    rate: float = 120.0
    frequency: int = 10_000_000
    drift_ppm: float = 40.0
    origin_s: float = 1.6e9
    latency_s: float = 0.006
    command_port: int = 0
    address: str = "127.0.0.1"
    silent: bool = False
    times_known: tuple[bool, bool, bool] = (True, True, True)
    garble: Callable[[bytes], bytes] | None = None
    sent: int = 0
    _clients: dict[tuple[str, int], float] = field(default_factory=dict)

    def __enter__(self) -> "NatNetServer":
        self._stop = threading.Event()
        self._command = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._command.bind((self.address, self.command_port))
        self._command.settimeout(0.05)
        self.command_port = self._command.getsockname()[1]
        self.data_port = self.command_port + 1 if self.multicast else 1511
        if self.multicast:
            self._command.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton(self.address))
            self._command.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_LOOP, 1)
        self._threads = [threading.Thread(target=loop, daemon=True) for loop in (self._answer, self._stream)]
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        for thread in self._threads:
            thread.join()
        self._command.close()

    def ticks(self, host_s: float) -> int:
        """The server's clock at the host's time."""
        return int((host_s - self.origin_s) * (1 + self.drift_ppm * 1e-6) * self.frequency)

    def _answer(self) -> None:
        while not self._stop.is_set():
            try:
                request, sender = self._command.recvfrom(65535)
            except (TimeoutError, OSError):
                continue
            received = time.time()
            if self.silent or len(request) < 4:
                continue
            identifier, _ = struct.unpack_from("<HH", request)
            if identifier == 0:
                self._clients[sender] = received
                self._send(1, self._server_info(), sender)
            elif identifier == 4:
                self._send(5, self._models(), sender)
            elif identifier == 10:
                self._clients[sender] = received
            elif identifier == 12:
                self._send(13, request[4:12] + struct.pack("<Q", self.ticks(received)), sender)

    def _stream(self) -> None:
        start = time.time()
        waiting: list[tuple[float, bytes]] = []
        number = 0
        while not self._stop.is_set():
            due = start + number / self.rate
            time.sleep(max(0.0, min(due - time.time(), 0.05)))
            if time.time() < due:
                continue
            number += 1
            waiting.append((due + self.latency_s, self._frame(number, due)))
            while waiting and waiting[0][0] <= time.time():
                _, payload = waiting.pop(0)
                if not self.silent:
                    self._broadcast(payload)

    def _broadcast(self, payload: bytes) -> None:
        self.sent += 1
        if self.multicast:
            self._send(7, payload, (self.multicast, self.data_port))
            return
        now = time.time()
        for client, heard in list(self._clients.items()):
            if now - heard < 3.0:
                self._send(7, payload, client)

    def _send(self, identifier: int, payload: bytes, to: tuple[str, int]) -> None:
        datagram = struct.pack("<HH", identifier, len(payload)) + payload
        self._command.sendto(self.garble(datagram) if self.garble else datagram, to)

    def _server_info(self) -> bytes:
        group = socket.inet_aton(self.multicast or "0.0.0.0")
        return (
            b"Virtual Motive".ljust(256, b"\0")
            + bytes([3, 1, 0, 0, *self.version, 0, 0])
            + struct.pack("<QH?", self.frequency, self.data_port, bool(self.multicast))
            + group
        )

    def _sized(self, content: bytes) -> bytes:
        return (struct.pack("<I", len(content)) if self.version >= (4, 1) else b"") + content

    def _models(self) -> bytes:
        markers = b"all\0" + struct.pack("<I", 2) + b"one\0two\0"
        datasets = [struct.pack("<I", 0) + self._sized(markers)]
        for identifier, name in enumerate(self.bodies, 1):
            body = name.encode() + b"\0" + struct.pack("<ii3f", identifier, -1, 0, 0, 0)
            body += struct.pack("<4f", 0, 0, 0, 1) if self.version >= (4, 2) else b""
            body += struct.pack("<I", 3) + struct.pack("<9f", *range(9)) + struct.pack("<3I", 0, 0, 0)
            body += b"a\0b\0c\0" if self.version >= (4, 0) else b""
            datasets.append(struct.pack("<I", 1) + self._sized(body))
        return struct.pack("<I", len(datasets)) + b"".join(datasets)

    def _frame(self, number: int, exposed_s: float) -> bytes:
        marker_set = b"all\0" + struct.pack("<I", 2) + struct.pack("<6f", *range(6))
        bodies = b""
        for identifier, pose_at in enumerate(self.bodies.values(), 1):
            pose = pose_at(exposed_s)
            position, quaternion = pose or ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
            bodies += struct.pack("<i3f4ffH", identifier, *position, *quaternion, 0.0004, 1 if pose else 0)
        marker = struct.pack("<I3ffHf", 1, 0.1, 0.2, 0.3, 0.01, 0, 0.0002)
        frame = struct.pack("<I", number)
        frame += struct.pack("<I", 1) + self._sized(marker_set)
        frame += struct.pack("<I", 1) + self._sized(struct.pack("<3f", 1, 2, 3))
        frame += struct.pack("<I", len(self.bodies)) + self._sized(bodies)
        frame += struct.pack("<I", 0) + self._sized(b"")  # skeletons
        frame += (struct.pack("<I", 0) + self._sized(b"")) if self.version >= (4, 1) else b""  # assets
        frame += struct.pack("<I", 1) + self._sized(marker)
        frame += 2 * (struct.pack("<I", 0) + self._sized(b""))  # force plates, devices
        exposed = self.ticks(exposed_s)
        received, sent = self.ticks(exposed_s + 0.004), self.ticks(exposed_s + self.latency_s)
        times = (ticks * known for ticks, known in zip((exposed, received, sent), self.times_known, strict=True))
        frame += struct.pack("<IId3Q", 0, 0, number / self.rate, *times)
        frame += struct.pack("<II", 0, 0) if self.version >= (4, 1) else b""
        return frame + struct.pack("<HI", 0, 0)
