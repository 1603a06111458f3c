"""Made-up results of studies as fixtures."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from made_results import BOX, PAPER_CASES, UNITS, MadeResults, make


@pytest.fixture(scope="session")
def made() -> Callable[..., MadeResults]:
    """Return the function that makes up results."""
    return make


@pytest.fixture(scope="session")
def table1_cases() -> list[dict[str, Any]]:
    """Return the five rows of Table I."""
    return PAPER_CASES


@pytest.fixture(scope="session")
def many_cases() -> list[dict[str, Any]]:
    """Return 24 random truths."""
    rng = np.random.default_rng(7)
    return [{"name": f"case {i:02d}", "truth": {p: float(rng.uniform(*BOX[p])) for p in UNITS}} for i in range(1, 25)]
