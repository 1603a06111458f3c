"""Fit temperature and priors by kind to closed campaigns, and print `calibration.toml`.

    python studies/calibration/fit.py FOLDER [--judge FOLDER ...]

--judge: runs of other seeds, whose score with the fitted numbers tells whether these are more than chance.
The models of each mixture are weighted anew by log evidence / temperature + log prior odds. What is minimised is the
mean log score of all statements: each effect, each faulty record, something unknown (Good 1952).
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import numpy as np
from scipy.optimize import minimize
from scipy.special import logsumexp

from armid.inference.decisions import calibration
from armid.inference.posterior import UNSEEN
from calibration.score import read
from calibration.scores import Closed

KINDS = ("effect", "record", "drift", "unknown")
# A probability counts as no surer than this, so that no single campaign decides.
SUREST = 1e-3
# Prior standard deviation of a change of temperature or of an expected number, as a logarithm: a factor of 3.
LARGE = np.log(3.0)


def main(words: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(prog="fit.py", description="Fit temperature and priors by kind.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--judge", type=Path, nargs="+", default=[])
    given = parser.parse_args(words)
    plan, every = mixtures(given.folder)
    first = np.zeros(1 + len(KINDS))
    found = minimize(lambda x: loss(every, x), first, method="Nelder-Mead", options={"xatol": 1e-2, "fatol": 1e-5})
    # Priors alone, for a temperature that says nothing.
    plain = minimize(lambda x: loss(every, np.concatenate([[0.0], x])), first[1:], method="Nelder-Mead")
    before = calibration()
    scores = f"{loss(every, first):.4f} before, {found.fun:.4f} after, {plain.fun:.4f} with temperature 1"
    print(f"# Seed {plan['seed']}, {len(every)} campaigns: mean log score {scores}.")
    print(f"temperature = {np.exp(found.x[0]):.2f}\n\n[expected]")
    for kind, more, alone in zip(KINDS, found.x[1:], plain.x, strict=True):
        was = before.expected[kind]
        print(f"{kind} = {was * np.exp(more):.2g}  # with temperature 1: {was * np.exp(alone):.2g}")
    for folder in given.judge:
        plan, others = mixtures(folder)
        gains = [one.loss(first) - one.loss(found.x) for one in others]
        error = np.std(gains, ddof=1) / np.sqrt(len(gains))
        print(f"# Seed {plan['seed']}, {len(others)} campaigns: with the fitted numbers the mean log score falls by "
              f"{np.mean(gains):.3f} (standard error {error:.3f}).")  # fmt: skip
    return 0


def mixtures(folder: Path) -> tuple[Any, list["Mixture"]]:
    """Return the plan of a run and its campaigns; two kinds of machine judge a fit and take no part in it."""
    plan, closed, _ = read(folder)
    return plan, [Mixture(one) for one in closed if one.group != "left out"]


class Mixture:
    """Hold the models of one campaign as arrays, and the statements that are true or false of it."""

    def __init__(self, one: Closed) -> None:
        models = one.answer["mixture"]
        sets = [frozenset((kind, name) for kind, name in m["names"]) for m in models]
        self.evidence = np.array([m["log_evidence"] for m in models])
        self.prior = np.array([m["log_prior"] for m in models])
        # What tests alone find keeps its prior.
        self.counts = np.array(
            [[sum(k == kind and (k, n) not in UNSEEN for k, n in s) for kind in KINDS] for s in sets]
        )
        unknown = np.array([any(k == "unknown" for k, _ in s) for s in sets])
        self.holds, self.true = [unknown], [float(one.is_unlisted and one.leaves_declared)]
        names = {n for s in sets for n in s if n[0] in ("effect", "record", "drift")}
        chances = {n: float(np.sum(self.weights(np.zeros(5)) * [("effect", n) in s for s in sets])) for k, n in names
                   if k == "effect"}  # fmt: skip
        for kind, name in sorted(names):
            self.holds.append(np.array([(kind, name) in s for s in sets]) & ~(unknown & (kind == "effect")))
            self.true.append(one.truth.share(name, chances) if kind == "effect" else float(is_fault(one, kind, name)))

    def weights(self, x: Any) -> Any:
        each = self.evidence / np.exp(x[0]) + self.prior + self.counts @ x[1:]
        return np.exp(each - logsumexp(each))

    def loss(self, x: Any) -> float:
        weights, total = self.weights(x), 0.0
        for holds, true in zip(self.holds, self.true, strict=True):
            p = float(np.clip(weights @ holds, SUREST, 1.0 - SUREST))
            total -= true * np.log(p) + (1.0 - true) * np.log(1.0 - p)
        return total


def is_fault(one: Closed, kind: str, name: str) -> bool:
    """Tell whether a fault of a record is the planted one: its record and its kind, in the words of the library."""
    fault = one.truth.fault
    if kind != "record" or not fault or fault.get("role") != "train":
        return False
    what, _, where = name.partition("@")
    return where.split(":")[0] == fault["record"] and what.split("_")[0] == fault["kind"]


def loss(every: Sequence[Mixture], x: Any) -> float:
    """Return the mean log score, with a normal prior on each change, so that few campaigns do not run away."""
    return float(np.mean([one.loss(x) for one in every]) + 0.5 * np.sum((x / LARGE) ** 2) / len(every))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
