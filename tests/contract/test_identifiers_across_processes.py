"""The same seed asks for the same candidates in another process, bit for bit."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from armid.identifiers import IDENTIFIERS

NAMES = (*IDENTIFIERS, "pso+bobyqa", "de+nelder_mead+sbplx", "cmaes+least_squares", "multistart:lbfgs")
SCRIPT = """
import hashlib, json, sys
from armid.contract.identifier import BUDGET, Trial, run
from armid.identifiers import IDENTIFIERS, identifier_of
from armid.problem.meter import Meter
found = {}
for name in sys.argv[1:]:
    log = run(identifier_of(name, IDENTIFIERS), 7, Trial(Meter(BUDGET), holes=True))[0].log()
    found[name] = hashlib.sha256(log.X.tobytes() + log.F.tobytes()).hexdigest()
print(json.dumps(found))
"""


def logs(hash_seed: str) -> dict[str, str]:
    """Fingerprint of each identifier's log, from a process of its own."""
    paths = [str(Path(__file__).parents[2] / "src"), os.environ.get("PYTHONPATH", "")]
    told = os.environ | {"PYTHONHASHSEED": hash_seed, "PYTHONPATH": os.pathsep.join(p for p in paths if p)}
    told_to = [sys.executable, "-c", SCRIPT, *NAMES]
    done = subprocess.run(told_to, env=told, stdout=subprocess.PIPE, text=True, check=True)
    return dict(json.loads(done.stdout.splitlines()[-1]))


@pytest.mark.slow
def test_two_processes_ask_for_the_same() -> None:
    first, second = logs("1"), logs("2")
    assert set(first) == set(NAMES)
    assert len(set(first.values())) == len(NAMES)
    assert first == second
