"""Lists of texts as users type them: a JSON list, a single text, or several separated by commas."""

from typing import Annotated

from pydantic import BeforeValidator


def _split(value: object) -> object:
    """Return the texts of one with commas; anything else as it is."""
    return tuple(part for part in map(str.strip, value.split(",")) if part) if isinstance(value, str) else value


TextList = Annotated[tuple[str, ...], BeforeValidator(_split)]
"""A setting that is a list of texts."""
