"""NatNet datagrams, by the protocol's description: reading rigid bodies with their capture times, and requests.

Little-endian: message id and payload size (uint16 each), then the payload. From protocol 4.1 on the sections of a frame
and the descriptions of the models carry their size. The end of a frame (time stamps and flags) is read from its end, so
that other sections (skeletons, force plates, assets) need not be understood.
"""

from dataclasses import dataclass
from enum import IntEnum, unique
from struct import Struct, error

from odom.errors import WireError
from sensors.optitrack.settings import NATNET_VERSION


@unique
class Id(IntEnum):
    """Message identifiers."""

    CONNECT = 0
    SERVER_INFO = 1
    REQUEST_MODELS = 4
    MODELS = 5
    FRAME = 7
    KEEP_ALIVE = 10
    ECHO_REQUEST = 12
    ECHO_RESPONSE = 13


Version = tuple[int, int]

_HEADER = Struct("<HH")
_COUNT = Struct("<I")
_INT = Struct("<i")
_ECHO = Struct("<QQ")
_SERVER = Struct("<256s4B4BQH?4B")
_BODY = Struct("<i3f4ffH")
_TAIL_30 = Struct("<IId3QHI")
_TAIL_41 = Struct("<IId3QIIHI")
_MOST_BODIES = 4096
"""A frame that announces more rigid bodies is damaged: Motive tracks some hundred."""

OLDEST: Version = (3, 0)
"""Motive 2.0; older streams have no capture time."""


@dataclass(frozen=True)
class ServerInfo:
    """Who streams: `frequency` is the ticks per second of its clock, `multicast` the group, None for unicast."""

    name: str
    version: Version
    frequency: int
    data_port: int
    multicast: str | None


@dataclass(frozen=True)
class Body:
    """A rigid body in one frame, axes as streamed: metres, quaternion x, y, z, w."""

    identifier: int
    position: tuple[float, float, float]
    quaternion: tuple[float, float, float, float]
    valid: bool


@dataclass(frozen=True)
class Frame:
    """One frame: `exposed` (middle), `received` and `sent` are times in ticks of the server's clock (0 unknown)."""

    number: int
    bodies: tuple[Body, ...]
    exposed: int
    received: int
    sent: int
    models_changed: bool


class _Reader:
    """A cursor over a datagram; raises WireError at its end."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.at = 0

    def take(self, form: Struct) -> tuple[float, ...]:
        try:
            values: tuple[float, ...] = form.unpack_from(self.data, self.at)
        except error as problem:
            raise WireError(f"NatNet datagram of {len(self.data)} bytes is cut") from problem
        self.at += form.size
        return values

    def integer(self, form: Struct = _COUNT) -> int:
        return int(self.take(form)[0])

    def skip(self, size: int) -> None:
        if not 0 <= size <= len(self.data) - self.at:
            raise WireError(f"NatNet datagram of {len(self.data)} bytes is cut")
        self.at += size

    def text(self) -> str:
        end = self.data.find(b"\0", self.at)
        if end < 0:
            raise WireError("NatNet datagram holds a name without end")
        name = self.data[self.at : end].decode(errors="replace")
        self.at = end + 1
        return name


def packet(identifier: Id, payload: bytes = b"") -> bytes:
    """Return a datagram."""
    return _HEADER.pack(identifier, len(payload)) + payload


def split(datagram: bytes) -> tuple[int, bytes]:
    """Return a datagram's identifier and payload; raises WireError when its size is not what its header says."""
    if len(datagram) < _HEADER.size:
        raise WireError("NatNet datagram without header")
    identifier, size = _HEADER.unpack_from(datagram)
    if size > len(datagram) - _HEADER.size:
        raise WireError(f"NatNet datagram of {len(datagram)} bytes announces {size}")
    return identifier, datagram[_HEADER.size : _HEADER.size + size]


def connect_request() -> bytes:
    """Return the request to connect, which asks a unicast server for the protocol's version of the settings."""
    return packet(Id.CONNECT, b"Ping".ljust(264, b"\0") + bytes([0, *NATNET_VERSION, 0, 0, 0]))


def echo_request(stamp: int) -> bytes:
    """Return the request for the server's time; `stamp` comes back with it."""
    return packet(Id.ECHO_REQUEST, stamp.to_bytes(8, "little"))


def read_echo(payload: bytes) -> tuple[int, int]:
    """Return the request's stamp and the server's ticks at its receipt."""
    stamp, ticks = _Reader(payload).take(_ECHO)
    return int(stamp), int(ticks)


def read_server_info(payload: bytes) -> ServerInfo:
    """Return who answered; raises WireError for one whose protocol is too old to know capture times."""
    if len(payload) < 264:
        raise WireError("NatNet server information is cut")
    version = payload[260], payload[261]
    if version < OLDEST or len(payload) < _SERVER.size:
        raise WireError(f"the NatNet server speaks {version[0]}.{version[1]}: capture times need 3.0 (Motive 2.0)")
    name, *_, frequency, port, multicast, a, b, c, d = _SERVER.unpack_from(payload)
    if frequency == 0:
        raise WireError("the NatNet server does not say the frequency of its clock")
    text = name.split(b"\0")[0].decode(errors="replace")
    return ServerInfo(text, version, frequency, port, f"{a}.{b}.{c}.{d}" if multicast else None)


def read_models(payload: bytes, version: Version) -> dict[int, str]:
    """Return the names of the rigid bodies by identifier."""
    reader = _Reader(payload)
    names: dict[int, str] = {}
    for _ in range(reader.integer()):
        kind = reader.integer()
        end = None
        if version >= (4, 1):
            size = reader.integer()
            end = reader.at + size
        if kind == 1:
            name, identifier = _rigid_body(reader, version)
            names[identifier] = name
        elif end is None and not _skip_description(reader, kind, version):
            break  # without its size nothing behind it can be read
        if end is not None:
            reader.at = min(reader.at, end)
            reader.skip(end - reader.at)
    return names


def _rigid_body(reader: _Reader, version: Version) -> tuple[str, int]:
    name = reader.text()
    identifier = reader.integer(_INT)
    reader.skip(4 + 12 + (16 if version >= (4, 2) else 0))
    markers = reader.integer()
    reader.skip(markers * 16)
    if version >= (4, 0):
        for _ in range(markers):
            reader.text()
    return name, identifier


def _skip_description(reader: _Reader, kind: int, version: Version) -> bool:
    if kind == 0:
        reader.text()
        for _ in range(reader.integer()):
            reader.text()
    elif kind == 2:
        reader.text()
        reader.skip(4)
        for _ in range(reader.integer()):
            _rigid_body(reader, version)
    elif kind == 5:
        reader.text()
        reader.skip(28)
    else:
        return False
    return True


def read_frame(payload: bytes, version: Version) -> Frame:
    """Return a frame's rigid bodies and times; raises WireError for what is cut or contradicts itself."""
    sized = version >= (4, 1)
    reader = _Reader(payload)
    number = reader.integer()
    sets = reader.integer()
    if sized:
        reader.skip(reader.integer())
    else:
        for _ in range(sets):
            reader.text()
            reader.skip(12 * reader.integer())
    others = reader.integer()
    reader.skip(reader.integer() if sized else 12 * others)
    count = reader.integer()
    if sized:
        reader.integer()
    if count > _MOST_BODIES:
        raise WireError(f"NatNet frame announces {count} rigid bodies")
    bodies = tuple(_body(reader) for _ in range(count))
    form = _TAIL_41 if sized else _TAIL_30
    reader.at = max(reader.at, len(payload) - form.size)
    _, _, _, exposed, received, sent, *_, flags, end = reader.take(form)
    if end != 0:
        raise WireError("NatNet frame does not end where it should")
    if exposed and not exposed <= received <= sent:
        raise WireError("NatNet frame was sent before it was taken")
    return Frame(number, bodies, int(exposed), int(received), int(sent), bool(int(flags) & 2))


def _body(reader: _Reader) -> Body:
    identifier, x, y, z, qx, qy, qz, qw, _, flags = reader.take(_BODY)
    return Body(int(identifier), (x, y, z), (qx, qy, qz, qw), bool(int(flags) & 1))
