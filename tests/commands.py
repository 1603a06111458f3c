"""Commands of armid run in this process."""

import pytest

from armid.cli.main import main


def ended(*arguments: object) -> int:
    """Return the exit code of a command."""
    with pytest.raises(SystemExit) as left:
        main([str(a) for a in arguments])
    return int(left.value.code or 0)
