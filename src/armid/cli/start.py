"""How a command is asked to end."""

import signal
import threading
from typing import Any

INTERRUPTED = 130


def end_on_request() -> None:
    """Let SIGTERM end the command as Ctrl-C does, where nobody else listens to it."""
    if threading.current_thread() is threading.main_thread() and signal.getsignal(signal.SIGTERM) is signal.SIG_DFL:
        signal.signal(signal.SIGTERM, asked_to_end)


def asked_to_end(number: int, frame: Any) -> None:
    """End as by Ctrl-C, so that what is half-written goes; also where Ctrl-C is ignored, as in the background."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.default_int_handler(number, frame)
    signal.raise_signal(signal.SIGINT)
