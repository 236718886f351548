"""Quality of service as rmw_zenoh writes it into a token: only what differs from its defaults."""

from dataclasses import dataclass

_DEFAULT_DEPTH = 42
"""Messages; what rmw_zenoh takes where none is given, and leaves out."""
TRANSFORMS_DEPTH = 100
"""Transforms that may wait, of all their publishers together; what tf2's listeners take."""
_TRANSIENT_LOCAL, _BEST_EFFORT, _KEEP_ALL = "1", "2", "2"
_UNLIMITED = ":,:,:,,"
"""Deadline, lifespan and liveliness: their defaults, which are all without a limit."""


@dataclass(frozen=True)
class Qos:
    """What a publisher promises or a subscriber asks for.

    `depth` messages are kept (0: all). A `transient_local` publisher gives them to those that subscribe later.
    """

    depth: int = 10
    transient_local: bool = False
    reliable: bool = True

    def token(self) -> str:
        """Return the last part of a liveliness token, such as `::,10:,:,:,,`."""
        reliability = "" if self.reliable else _BEST_EFFORT
        durability = _TRANSIENT_LOCAL if self.transient_local else ""
        history = f"{_KEEP_ALL}," if self.depth == 0 else f",{'' if self.depth == _DEFAULT_DEPTH else self.depth}"
        return f"{reliability}:{durability}:{history}{_UNLIMITED}"


def qos_of(token: str) -> Qos:
    """Return what a token's last part says; a part that cannot be read stands for its default."""
    reliability, durability, history, *_ = [*token.split(":"), "", "", ""]
    kind, _, depth = history.partition(",")
    kept = int(depth) if depth.isdecimal() and len(depth) < 10 else _DEFAULT_DEPTH
    return Qos(0 if kind == _KEEP_ALL else kept, durability == _TRANSIENT_LOCAL, reliability != _BEST_EFFORT)
