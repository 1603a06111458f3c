"""Run the command line, as `armid` and as `python -m armid`; a request to end counts from the first moment."""

import atexit
import os
import signal
import sys
from contextlib import suppress
from typing import Any

from armid.errors import INTERRUPTED


def run() -> None:
    """Run the command of this process; asked to end while it is being imported, it ends as it does later."""
    code: list[object] = []
    # first registered, and so the last that is called
    atexit.register(keep_code, code)
    try:
        open_closed_streams()
        try:
            end_on_request()
            from armid.cli.main import main

            main()
        finally:
            # the exit code stands, and a signal that comes while Python ends must not take its place
            signal.signal(signal.SIGINT, signal.SIG_IGN)
            signal.signal(signal.SIGTERM, signal.SIG_IGN)
    except KeyboardInterrupt:
        code.append(INTERRUPTED)
        with suppress(OSError):
            print("armid: interrupted", file=sys.stderr)
        sys.exit(INTERRUPTED)
    except SystemExit as left:
        code.append(left.code)
        raise


def keep_code(code: list[object]) -> None:
    """End with 130 after an interrupt: one that came within `exec` makes Python end by SIGINT, whatever the code."""
    if code == [INTERRUPTED]:
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError):
                stream.flush()
        os._exit(INTERRUPTED)


def open_closed_streams() -> None:
    """Let what is written to a stream that was closed before the start go nowhere.

    Otherwise the next file that is opened takes the number of the stream, and what is written to the stream.
    """
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115 - it stays open to the end


def end_on_request() -> None:
    """Let SIGTERM end the command as Ctrl-C does, where nobody else listens to it."""
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


if __name__ == "__main__":
    run()
