"""Made-up results of studies as fixtures."""

from collections.abc import Callable

import pytest
from made_results import MadeResults, make


@pytest.fixture(scope="session")
def made() -> Callable[..., MadeResults]:
    """Return the function that makes up results."""
    return make
