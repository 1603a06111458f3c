"""Let the tests import the test stand, which lives beside the package and not in it."""

import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "studies"))
