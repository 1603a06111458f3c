"""Made-up results of studies as fixtures."""

import pytest
from made_results import make


@pytest.fixture(scope="session")
def made():
    """Return the function that makes up results."""
    return make
