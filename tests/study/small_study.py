"""A small study of the arm, identifiers that misbehave, and when two stores hold the same."""

from armid.study.results import StudyResults

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
import sys
import time

from pymoo.algorithms.soo.nonconvex.de import DE


class Bad(DE):
    """Misbehave in the second generation."""

    def _advance(self, **_):
        self.misbehave()


class Hangs(Bad):
    def misbehave(self):
        while True:
            time.sleep(60.0)


class Segfaults(Bad):
    def misbehave(self):
        ctypes.string_at(0)


class Leaves(Bad):
    def misbehave(self):
        sys.exit(3)


class Raises(Bad):
    def misbehave(self):
        raise ZeroDivisionError("nothing to divide by")


def hangs(budget):
    return Hangs(pop_size=10)


def segfaults(budget):
    return Segfaults(pop_size=10)


def leaves(budget):
    return Leaves(pop_size=10)


def raises(budget):
    return Raises(pop_size=10)


def cannot_be_built(budget):
    return 1 / 0
'''
# What is told of a run for people; everything else of it has to be the same whoever made it and when.
NOT_COMPARED = ["seconds", "started_at"]


def same_results(one: StudyResults, two: StudyResults) -> bool:
    """Tell whether two stores hold the same runs, parameters and traces, bit for bit."""
    assert one.runs["error"].tolist() == two.runs["error"].tolist()
    runs = one.runs.drop(columns=NOT_COMPARED).equals(two.runs.drop(columns=NOT_COMPARED))
    parameters, traces = one.parameters.equals(two.parameters), one.traces.equals(two.traces)
    return runs and parameters and traces
