"""Run the command line, as `armid` and as `python -m armid`; a request to end counts from the first moment."""

import sys

from armid.cli.start import INTERRUPTED, end_on_request


def run() -> None:
    """Run the command of this process; asked to end while it is being imported, it ends as it does later."""
    try:
        end_on_request()
        from armid.cli.main import main

        main()
    except KeyboardInterrupt:
        print("armid: interrupted", file=sys.stderr)
        sys.exit(INTERRUPTED)


if __name__ == "__main__":
    run()
