"""Commands of armid run in this process, and figures that are not drawn."""

import pytest

from armid.cli.main import main
from armid.report.style import pyplot


def ended(*arguments: object) -> int:
    """Return the exit code of a command."""
    with pytest.raises(SystemExit) as left:
        main([str(a) for a in arguments])
    return int(left.value.code or 0)


def not_drawn(figure, *paths):
    """Stand in for the function that saves a figure, or for the one that returns its SVG."""
    pyplot().close(figure)
    for path in paths:
        path.write_text("<svg/>")
    return "<svg/>"
