"""An end for tests that read a source which might never end by itself."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from sensors.source import Source


@contextmanager
def closed_after(seconds: float, source: Source) -> Iterator[None]:
    """Close the source at the end of the block, or `seconds` after its beginning, so that what reads it ends."""
    late = threading.Timer(seconds, source.close)
    late.start()
    try:
        yield
    finally:
        late.cancel()
        source.close()
