"""Run the command line, as `armid` and as `python -m armid`; a request to end counts from the first moment."""

import atexit
import os
import signal
import sys
from contextlib import suppress

from armid.cli.start import end_on_request, open_closed_streams
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


if __name__ == "__main__":
    run()
