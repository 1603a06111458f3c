"""A small campaign, files that plug-ins are read from, and commands in processes of their own."""

import pytest

PLUGINS = '''\
"""Things of a user."""

import numpy as np
from pymoo.algorithms.soo.nonconvex.de import DE

from armid import Effect, Parameter

LEVEL = (Parameter("c", "effort", 0.0, 0.5, null=0.0),)


def drag(omega, c):
    """Drag [N m]."""
    return -c * omega**3


def lost(omega, c, omga):
    """Ask for what is not there."""
    return c * omga


cubic_drag = Effect("cubic_drag", LEVEL, {"torque": drag})
unknown_name = Effect("unknown_name", LEVEL, {"torque": lost})
unknown_port = Effect("unknown_port", LEVEL, {"torqe": drag})
coulomb = Effect("coulomb", LEVEL, {"torque": drag})
number = 3


def largest_miss(measured, simulated):
    """Largest deviation."""
    return np.abs(simulated - measured).max(axis=1)


def rmse(measured, simulated):
    """Stand in for ours."""
    return largest_miss(measured, simulated)


def misspelt(measured, simulated, nois):
    """Ask for a misspelt quantity."""
    return nois


def one_number(measured, simulated):
    """Return one number for all."""
    return 1.0


def raising(measured, simulated):
    """Fail in the search."""
    raise ZeroDivisionError("nothing to divide by")


def diverging(measured, simulated):
    """Call every candidate lost."""
    return np.full(len(simulated), np.nan)


def evolution(budget):
    """Search by differential evolution."""
    return DE(pop_size=20)


def no_algorithm(budget):
    """Return no algorithm."""
    return budget
'''


@pytest.fixture(scope="session")
def small_folder(paper_arm_folder, tmp_path_factory):
    """The committed campaign with one lowering to train on and one to hold out: two records are drawn, not seven."""
    folder = tmp_path_factory.mktemp("small")
    head, *records = (paper_arm_folder / "campaign.toml").read_text(encoding="utf-8").split("[[records]]")
    kept = [text for text in records if '"lower.csv"\nrole' in text or '"lower_low_voltage.csv"' in text]
    (folder / "campaign.toml").write_text("[[records]]".join([head, *kept]), encoding="utf-8")
    for name in ("lower.csv", "lower_low_voltage.csv"):
        (folder / name).write_bytes((paper_arm_folder / name).read_bytes())
    return folder


@pytest.fixture(scope="session")
def mine(tmp_path_factory):
    file = tmp_path_factory.mktemp("plugins") / "mine.py"
    file.write_text(PLUGINS, encoding="utf-8")
    return file


@pytest.fixture
def in_a_folder(tmp_path, monkeypatch):
    """Commands write into a working folder of their own."""
    monkeypatch.chdir(tmp_path)
