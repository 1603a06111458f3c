"""Run the command line, as `armid` and as `python -m armid`; a request to end counts from the first moment."""

import signal
import sys

from armid.cli.start import INTERRUPTED, end_on_request, open_closed_streams


def run() -> None:
    """Run the command of this process; asked to end while it is being imported, it ends as it does later."""
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
        print("armid: interrupted", file=sys.stderr)
        sys.exit(INTERRUPTED)


if __name__ == "__main__":
    run()
