"""Names by which rigid bodies are told apart in keys, which hold fewer letters than Motive allows."""

from collections import Counter

from odom.wire import truth

_LONGEST = 48
"""Characters of a name before its number: a key keeps 64, of which a number may take eleven."""


def names_of(said: dict[int, str], body: str) -> tuple[dict[int, str], str]:
    """Return the bodies' names by identifier, and in words what is wrong with those `said`, empty for nothing.

    The identifier is added to those that would share a key, unless a single `body` is chosen.
    """
    if body:
        there = ", ".join(sorted(said.values()))
        return said, "" if body in said.values() else f"no rigid body is called {body!r}: there are {there}"
    bodies = Counter(map(truth, said.values()))
    names = {
        identifier: f"{name[:_LONGEST]}_{identifier}" if bodies[truth(name)] > 1 else name
        for identifier, name in said.items()
    }
    renamed = ", ".join(sorted(set(names.values()) - set(said.values())))
    return names, f"rigid bodies whose names would share a key are called {renamed}" if renamed else ""
