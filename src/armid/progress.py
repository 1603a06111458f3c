"""Tell of work that takes long, through the log `armid`, which the commands print."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Event, Thread
from time import monotonic

LOG = logging.getLogger("armid")
# When work is announced, and how often it is said again [s].
SLOW_S, AGAIN_S = 2.0, 15.0


@contextmanager
def announced(sentence: str) -> Iterator[None]:
    """Tell what is being done where it takes more than 2 s, and every 15 s from then on with the time that it took."""
    began, ended = monotonic(), Event()

    def announce() -> None:
        if not ended.wait(SLOW_S):
            LOG.info(sentence)
            while not ended.wait(AGAIN_S):
                LOG.info("%s (%.0f s)", sentence, monotonic() - began)

    Thread(target=announce, daemon=True).start()
    try:
        yield
    finally:
        ended.set()
