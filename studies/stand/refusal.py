"""The one exception of the stand."""


class RefusalError(ValueError):
    """Say in one sentence why the input makes no campaign."""
