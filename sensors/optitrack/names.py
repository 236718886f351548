"""Names by which rigid bodies are told apart in keys, which hold fewer letters than Motive allows."""

from collections import Counter

from odom.wire import truth

_LONGEST = 48
"""Characters of a name before its number: a key keeps 64, of which a number may take eleven."""


def names_of(said: dict[int, str], body: str) -> tuple[dict[int, str], str]:
    """Return the bodies' names by identifier, and in words what is wrong with those `said`, empty for nothing.

    The identifier is added to those that would share a key, and to all if that is not enough, unless a single `body`
    is chosen.
    """
    if body:
        there = ", ".join(sorted(said.values())) or "none"
        return said, "" if body in said.values() else f"no rigid body is called {body!r}: there are {there}"
    names = said
    for chosen in (_sharing(said), set(said)):
        if _sharing(names):
            names = {one: f"{name[:_LONGEST]}_{one}" if one in chosen else name for one, name in said.items()}
    renamed = ", ".join(sorted(name for identifier, name in names.items() if name != said[identifier]))
    return names, f"rigid bodies whose names would share a key are called {renamed}" if renamed else ""


def _sharing(names: dict[int, str]) -> set[int]:
    """Return the identifiers of the bodies whose names share a key with another one's."""
    bodies = Counter(map(truth, names.values()))
    return {identifier for identifier, name in names.items() if bodies[truth(name)] > 1}
