"""Run the command line as `python -m armid`."""

from armid.cli.main import main

if __name__ == "__main__":
    main()
