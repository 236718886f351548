"""Work that is done once more, whose log lines another process or an earlier look has written already."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def unlogged() -> Iterator[None]:
    """Write no log lines of this process until the block ends."""
    logging.disable()
    try:
        yield
    finally:
        logging.disable(logging.NOTSET)
