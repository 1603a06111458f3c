"""Run the command line as `python -m armid`."""

from armid.cli.start import run

if __name__ == "__main__":
    run()
