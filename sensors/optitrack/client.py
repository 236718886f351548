"""A NatNet client: rigid bodies with their capture time in this machine's clock, from unicast or multicast servers."""

import logging
import select
import socket
import struct
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from dataclasses import dataclass

from odom.errors import SourceError, WireError
from odom.frame import Stamp
from sensors.host_time import ClockMapping
from sensors.optitrack import packets
from sensors.optitrack.names import names_of
from sensors.optitrack.packets import Body, Frame, Id, ServerInfo
from sensors.optitrack.settings import OptiTrackSettings

_log = logging.getLogger(__name__)

ECHO_S, FIRST_ECHO_S = 0.25, 0.02
"""Seconds between two round trips that relate the clocks, later and at first: more of them follow a drift closer."""
FIRST_ECHOES = 8
"""Round trips before the first pose, and that after a silence (the server may be a new one): the quickest counts."""
KEEP_ALIVE_S = 0.5
"""Seconds between two signs of life: a unicast server stops streaming to a client that is silent for some seconds."""
SILENCE_S = 2.0
"""Seconds without a frame after which the server is asked again: shorter asks in vain in pauses, longer loses truth."""
ASK_AGAIN_S = 1.0
"""Seconds between two requests for the names of bodies: shorter burdens a server that does not say them."""
MOST_LOST = 1_000_000
"""A larger jump of frame numbers is a server that was started anew, of which no more than this counts as lost."""
_BUFFER = 1 << 20
"""Bytes the system keeps for a socket: half a second of large frames at 240 Hz; smaller loses frames under load."""


@dataclass(frozen=True)
class BodyPose:
    """A rigid body as the server streams it, at its capture time in this machine's clock."""

    name: str
    stamp: Stamp
    body: Body


class NatNetClient:
    """Connects to `server`; raises SourceError when it does not answer. `counters` says what came and what was wrong.

    Datagrams of other senders are not looked at; malformed ones are counted and dropped.
    """

    def __init__(self, server: str, settings: OptiTrackSettings) -> None:
        self._settings = settings
        self.counters = {"frames": 0, "lost": 0, "malformed": 0, "untracked": 0, "undated": 0, "foreign": 0}
        self.clock = ClockMapping()
        self.end_s: float | None = None
        self._stop = threading.Event()
        self._names: dict[int, str] = {}
        self._fault = ""
        self._echoes = 0
        self._asked = -ASK_AGAIN_S
        self._last_frame: int | None = None
        self._sockets: list[socket.socket] = []
        self._groups = set[tuple[str, int]]()
        self.server: ServerInfo | None = None
        try:
            self._address = socket.gethostbyname(server), settings.command_port
            self._command = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            self._sockets.append(self._command)
            self._command.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)
            self._command.bind((settings.local, 0))
            self._connect(server)
        except OSError as error:
            self.close()
            raise SourceError(
                f"OptiTrack server {server} cannot be reached from {settings.local or 'here'}: {error}"
            ) from error
        except SourceError:
            self.close()
            raise

    def _connect(self, server: str) -> None:
        deadline = time.monotonic() + self._settings.timeout_s
        problem = ""
        while self.server is None:
            if time.monotonic() > deadline:
                raise SourceError(
                    f"no answer from the OptiTrack server {server} port {self._address[1]}{problem}: in Motive "
                    "switch on Streaming > Broadcast Frame Data, choose its network interface and Rigid Bodies, and "
                    "let UDP 1510 and 1511 through the firewalls"
                )
            self._send(packets.connect_request())
            try:
                self._wait(0.3)
            except WireError as error:
                problem = f" ({error})"
        self._join(self.server)
        self._send(packets.packet(Id.REQUEST_MODELS))
        _log.info(
            "OptiTrack %s, NatNet %d.%d, %s",
            self.server.name,
            *self.server.version,
            f"multicast {self.server.multicast}:{self.server.data_port}" if self.server.multicast else "unicast",
        )

    def _join(self, server: ServerInfo) -> None:
        """Listen to the group to which the server streams, if there is one that is not listened to yet."""
        if server.multicast is None or (group := (server.multicast, server.data_port)) in self._groups:
            return
        local = socket.inet_aton(self._settings.local or "0.0.0.0")
        with ExitStack() as unless_heard:
            data = unless_heard.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
            data.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            data.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)
            data.bind(group)
            data.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, socket.inet_aton(server.multicast) + local)
            unless_heard.pop_all()
        self._sockets.append(data)
        self._groups.add(group)

    def _wait(self, seconds: float) -> None:
        """Handle datagrams until the server has said who it is, for at most `seconds`; raises what is wrong with it."""
        end = time.monotonic() + seconds
        while self.server is None and (left := end - time.monotonic()) > 0:
            for identifier, payload, _ in self._receive(left):
                if identifier == Id.SERVER_INFO:
                    self.server = packets.read_server_info(payload)

    def _send(self, datagram: bytes) -> None:
        with suppress(OSError):  # a server that is gone is noticed by its silence
            self._command.sendto(datagram, self._address)

    def _receive(self, timeout: float) -> Iterator[tuple[int, bytes, int]]:
        """Yield identifier, payload and time of receipt (ns) of the datagrams that wait."""
        readable, _, _ = select.select(self._sockets, [], [], timeout)
        for ready in readable:
            try:
                datagram, sender = ready.recvfrom(65535)
            except OSError:
                continue  # the system reports here that an earlier datagram was refused
            received_ns = time.time_ns()
            if sender[0] != self._address[0]:
                self.counters["foreign"] += 1
                continue
            try:
                yield *packets.split(datagram), received_ns
            except WireError:
                self.counters["malformed"] += 1

    def poses(self) -> Iterator[BodyPose]:
        """Yield the poses of tracked bodies as they come, until `close` or `end_s` (time.monotonic), if set later."""
        self.end_s = None
        next_echo = next_alive = 0.0
        heard = time.monotonic()
        silent = False
        while not self._stop.is_set():
            now = time.monotonic()
            if self.end_s is not None and now >= self.end_s:
                return
            if now >= next_echo:
                next_echo = now + (ECHO_S if self._echoes >= FIRST_ECHOES else FIRST_ECHO_S)
                self._send(packets.echo_request(time.time_ns()))
            if now >= next_alive:
                next_alive = now + KEEP_ALIVE_S
                self._send(packets.packet(Id.KEEP_ALIVE))
            if now - heard > SILENCE_S:
                if not silent:
                    _log.error("the OptiTrack server has gone silent: asking it again")
                silent = True
                heard = now
                self._send(packets.connect_request())
                self._send(packets.packet(Id.REQUEST_MODELS))
            for identifier, payload, received_ns in self._receive(0.02):
                try:
                    frame = self._handle(identifier, payload, received_ns)
                except (WireError, struct.error):
                    self.counters["malformed"] += 1
                    continue
                if frame is None:
                    continue
                if silent:
                    _log.warning("the OptiTrack server streams again")
                    self._echoes = 0
                heard, silent = now, False
                yield from self._poses_of(frame)

    def _handle(self, identifier: int, payload: bytes, received_ns: int) -> Frame | None:
        server = self.server
        if server is None:
            return None
        if identifier == Id.FRAME:
            return packets.read_frame(payload, server.version)
        if identifier == Id.MODELS:
            names, fault = names_of(packets.read_models(payload, server.version), self._settings.body)
            if fault and fault != self._fault:
                _log.warning("%s", fault)
            self._names, self._fault = names, fault
        elif identifier == Id.ECHO_RESPONSE:
            sent_ns, ticks = packets.read_echo(payload)
            if not 0 <= (round_trip := received_ns - sent_ns) < 1_000_000_000:
                raise WireError("an echo of nothing that was sent")
            self._echoes += 1
            self.clock.observe(self._server_ns(ticks), sent_ns + round_trip // 2, round_trip)
        elif identifier == Id.SERVER_INFO:
            self.server = packets.read_server_info(payload)
            try:
                self._join(self.server)
            except OSError as error:
                _log.error("multicast %s:%d cannot be heard: %s", self.server.multicast, self.server.data_port, error)
        return None

    def _server_ns(self, ticks: int) -> int:
        return 0 if self.server is None else ticks * 1_000_000_000 // self.server.frequency

    def _poses_of(self, frame: Frame) -> Iterator[BodyPose]:
        if self._last_frame is not None:
            self.counters["lost"] += max(0, min(frame.number - self._last_frame - 1, MOST_LOST))
        self._last_frame = frame.number
        self.counters["frames"] += 1
        is_due = time.monotonic() - self._asked >= ASK_AGAIN_S
        if frame.models_changed or (is_due and any(body.identifier not in self._names for body in frame.bodies)):
            self._asked = time.monotonic()
            self._send(packets.packet(Id.REQUEST_MODELS))
        if self._echoes < FIRST_ECHOES:
            return
        ticks = frame.exposed or frame.received or frame.sent  # a take that is played back is only sent
        if not ticks:
            self.counters["undated"] += 1
            return
        stamp = self.clock.to_host(self._server_ns(ticks))
        for body in frame.bodies:
            name = self._names.get(body.identifier)
            if name is None:
                continue  # its name is on the way
            if not body.valid:
                self.counters["untracked"] += 1
            elif not self._settings.body or name == self._settings.body:
                yield BodyPose(name, stamp, body)

    def close(self) -> None:
        """Stop, say what came and what was wrong, and give the sockets back."""
        if self.server is not None and not self._stop.is_set():
            counts = ", ".join(f"{count} {name}" for name, count in self.counters.items())
            _log.info("OptiTrack %s: %s", self.server.name, counts)
        self._stop.set()
        for opened in self._sockets:
            opened.close()
        self._sockets = []
