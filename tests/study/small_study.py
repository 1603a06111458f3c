"""A small study of the arm, identifiers that misbehave, and when two stores hold the same."""

import re
import sqlite3
import time
from contextlib import closing

from armid.study.store import FILE_NAME

# What a runner says beside its output before it opens anything, and where nothing was compiled before.
COST = re.compile(
    r"(?:small: [\d,]+ runs, .+; what is finished already is kept\n|armid: (?:compiling|planning|reading) .+\n)+"
)
STUDY = """\
name = "small"
question = "Does it run?"
plant = "shell_transfer_arm"
budget = 40
seeds = {seeds}
fitness = "rmse"
noise_deg_s = [0.0, 0.3]
windows_s = [[0.0, 0.3]]
{more}

[[identifiers]]
name = "random"

[[identifiers]]
name = "pso"
fitness = ["rmse", "similarity"]
options = {{ velocity_limit = 0.2, n_particles = 10 }}

[[identifiers]]
name = "pso+least_squares"

[[cases]]
name = "row 1"
truth = {{ p0 = 3.20e6, k = 1.00, eta3 = 0.62, n = 1.00 }}
manoeuvres = [{{ start_angle_deg = -48.0, target_angle_deg = 22.0, shell = true, supply_V = 28.0, duration_s = 0.3 }}]

[[cases]]
name = "row 5"
truth = {{ p0 = 2.80e6, k = 0.80, eta3 = 0.50, n = 1.40 }}
manoeuvres = [
  {{ start_angle_deg = -48.0, target_angle_deg = 22.0, shell = true, supply_V = 28.0, duration_s = 0.3 }},
  {{ role = "holdout", start_angle_deg = -48, target_angle_deg = -8, shell = true, supply_V = 28, duration_s = 0.3 }},
]
"""
RUNS_A_SEED = 16
PLUGINS = '''\
"""Identifiers that misbehave."""

import ctypes
import os
import sys
import time

from pymoo.algorithms.soo.nonconvex.de import DE


class Bad(DE):
    """Misbehave in the second generation."""

    def __init__(self):
        super().__init__(pop_size=10)

    def _advance(self, **_):
        self.misbehave()


class hangs(Bad):
    def misbehave(self):
        while True:
            time.sleep(60.0)


class segfaults(Bad):
    def misbehave(self):
        ctypes.string_at(0)


class leaves(Bad):
    def misbehave(self):
        sys.exit(3)


class raises(Bad):
    def misbehave(self):
        raise ZeroDivisionError("nothing to divide by")


class interrupts(Bad):
    def misbehave(self):
        raise KeyboardInterrupt


class writes(Bad):
    def misbehave(self):
        for descriptor in range(3, 64):
            try:
                os.write(descriptor, b"\\x00\\x00\\x00\\x20what is not a message at all .....")
            except OSError:
                pass


def raises_when_built(budget):
    return 1 / 0


def hangs_when_built(budget):
    time.sleep(600.0)


def segfaults_when_built(budget):
    ctypes.string_at(0)
'''
# What is told of a run for people; everything else of it has to be the same whoever made it and when.
NOT_COMPARED = ["seconds", "started_at"]


def same_results(one, two):
    """Tell whether two stores hold the same runs, parameters and traces, bit for bit."""
    assert one.runs["error"].tolist() == two.runs["error"].tolist()
    runs = one.runs.drop(columns=NOT_COMPARED).equals(two.runs.drop(columns=NOT_COMPARED))
    parameters, traces = one.parameters.equals(two.parameters), one.traces.equals(two.traces)
    return runs and parameters and traces


def n_kept(out):
    """How many runs the store of a folder holds."""
    try:
        with closing(sqlite3.connect(f"file:{out / FILE_NAME}?mode=ro", uri=True)) as connection:
            return connection.execute("SELECT count(*) FROM runs").fetchone()[0]
    except sqlite3.OperationalError:
        # neither file nor tables may be made yet
        return 0


def wait_for(process, out, more_than=0):
    """Wait until a store holds more runs, or the process has ended."""
    end = time.monotonic() + 600.0
    while n_kept(out) <= more_than and process.poll() is None:
        assert time.monotonic() < end
        time.sleep(0.01)


def beside_cost(err):
    """Return what a runner writes to its error stream behind the cost of the study."""
    told = COST.match(err)
    assert told, err
    return err[told.end() :]
