"""The command line."""

from armid.cli.main import main

__all__ = ["main"]
