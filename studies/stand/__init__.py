"""Simulate and measure the shell transfer arm, independently of the package that identifies it."""


class RefusalError(ValueError):
    """Say in one sentence why the input makes no campaign."""
