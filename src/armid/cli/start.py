"""How a command begins, and how it is asked to end."""

import os
import signal
import sys
import threading
from typing import Any


def open_closed_streams() -> None:
    """Let what is written to a stream that was closed before the start go nowhere.

    Otherwise the next file that is opened takes the number of the stream, and what is written to the stream.
    """
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115 - it stays open to the end


def end_on_request() -> None:
    """Let SIGTERM end the command as Ctrl-C does, where nobody else listens to it."""
    if threading.current_thread() is not threading.main_thread():
        return
    if signal.getsignal(signal.SIGTERM) is signal.SIG_DFL:
        signal.signal(signal.SIGTERM, asked_to_end)
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, interrupt)


def interrupt(number: int, frame: Any) -> None:
    """Interrupt as Python does; objects that are cut off while they are made do not report that they cannot close."""
    sys.unraisablehook = lambda _: None
    signal.default_int_handler(number, frame)


def asked_to_end(number: int, frame: Any) -> None:
    """End as by Ctrl-C, so that what is half-written goes; also where Ctrl-C is ignored, as in the background."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.default_int_handler(number, frame)
    signal.raise_signal(signal.SIGINT)
