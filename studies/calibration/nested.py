"""Compare Laplace's log evidence, which the closed loop uses, with nested sampling, on synthetic campaigns of the arm.

    python studies/calibration/nested.py FOLDER --seed 1 --campaigns 20 --out results/nested

Needs UltraNest (Buchner 2021, doi:10.21105/joss.03001), the extra `nested`. Constants count as known exactly, so that
few dimensions are left. Of each campaign the models that lead are compared: evidence = integral of likelihood times
prior, both as in `armid.inference.evidence`. A run that was cut goes on where it stopped.
"""

import argparse
import json
import sys
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import numpy as np
import pandas as pd
from scipy.special import erf, ndtri
from ultranest import ReactiveNestedSampler

from armid.inference.evidence import SCALES_OF_STRENGTH, Expansion, Scale, expansion_of, log_evidence
from armid.inference.infer import infer, prepared
from armid.inference.kinds.hypothesis import words
from armid.record import read_campaign
from calibration.campaigns import Task, campaign_of, seconds, written

FAMILIES = ("control", "one", "two", "three", "fault")
# Models of a campaign, and how much less probable than the best one, as a log, the last of them may be.
MOST_MODELS, FARTHEST = 3, 12.0
N_LIVE, MOST_CALLS = 300, 400_000
# Shares of the declared size of a strength on which the distribution of its prior is tabulated.
SHARES = np.concatenate([[0.0], np.logspace(-8, 1.8, 4500)])
LARGEST_LOSS = -1e100
Draw = Callable[[np.ndarray], np.ndarray]


def main(words_given: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(prog="nested.py", description="Compare Laplace's evidence with nested sampling.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--campaigns", type=int, required=True)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args(words_given)
    warnings.simplefilter("ignore")
    (options.folder / "nested").mkdir(parents=True, exist_ok=True)
    rows: list[dict[str, Any]] = []
    for i in range(options.campaigns):
        task = Task(FAMILIES[i % len(FAMILIES)], i // len(FAMILIES))
        kept = options.folder / "nested" / f"{task.name}.json"
        if not kept.exists():
            written(kept, compared(options.folder, options.seed, task))
        rows += json.loads(kept.read_text())
    options.out.mkdir(parents=True, exist_ok=True)
    table = pd.DataFrame(rows)
    table.to_csv(options.out / "nested.csv", index=False, lineterminator="\n", float_format="%.5g")
    (options.out / "report.md").write_text(page(table, options.seed))
    return 0


def compared(folder: Path, seed: int, task: Task) -> list[dict[str, Any]]:
    """Return a row for each model of one campaign that leads."""
    there, _ = campaign_of(task, folder, seed, False)
    campaign = replace(read_campaign(there), tolerances={})
    exploration = infer(*prepared(campaign.model(), campaign)).exploration
    scale, ranked = exploration.scale(), exploration.ranked()
    near = [m for m, value in ranked if value > ranked[0][1] - FARTHEST and all(h.kind == "effect" for h in m)]
    rows = []
    for model in near[:MOST_MODELS]:
        fit = exploration.fits[model]
        about, before = expansion_of(fit, scale, exploration.library), seconds()
        log_z, error, calls = nested(about, scale)
        rows.append({
            "campaign": task.name, "model": words(model) if model else "nothing", "unknowns": fit.n_free,
            "laplace": log_evidence(about), "nested": log_z, "nested_error": error, "calls": calls,
            "cpu_s": seconds() - before,
        })  # fmt: skip
        print(rows[-1], flush=True)
    return rows


def nested(about: Expansion, scale: Scale) -> tuple[float, float, int]:
    """Return the log evidence of a model by nested sampling, its error, and the candidates that were simulated."""
    fit = about.fit
    draws, names = priors(about), list(fit.values)
    space = fit.records.space
    low, span = space.low[space.free], fit.records.span

    def transform(cube: np.ndarray) -> np.ndarray:
        return np.column_stack([draw(u) for draw, u in zip(draws, cube.T, strict=True)])

    def log_likelihood(x: np.ndarray) -> np.ndarray:
        chi2 = np.sum(fit.records.residuals((x - low) / span) ** 2, axis=1)
        logs = np.array([scale.log_likelihood(float(c)) if np.isfinite(c) else LARGEST_LOSS for c in chi2])
        return logs - 0.5 * fit.records.data.log_cover

    # UltraNest draws from the global generator alone
    np.random.seed(0)
    sampler = ReactiveNestedSampler(names, log_likelihood, transform, vectorized=True)
    found = sampler.run(min_num_live_points=N_LIVE, max_ncalls=MOST_CALLS, viz_callback=False, show_status=False,
                        dlogz=0.5, cluster_num_live_points=40, frac_remain=0.05)  # fmt: skip
    return float(found["logz"]), float(found["logzerr"]), int(found["ncall"])


def priors(about: Expansion) -> list[Draw]:
    """Return for each free parameter what makes a value [SI] of a share of its prior."""
    fit, library, space = about.fit, about.library, about.fit.records.space
    draws: list[Draw] = []
    places, means, deviations = fit.records.rows
    for i, (name, low, high) in enumerate(zip(fit.values, space.low[space.free], space.high[space.free], strict=True)):
        parameter, is_added = fit.model.parameters[name], library.owner(name) is not None
        if i in places:
            j = int(np.flatnonzero(places == i)[0])
            draws.append(lambda u, m=means[j], d=deviations[j]: m + d * ndtri(u))
        elif is_added and parameter.null is not None:
            one_sided = not low < parameter.null < high
            sign = -1.0 if parameter.null >= high else 1.0
            size = library.strength_of(name, parameter)
            draws.append(strength(parameter.null, sign * size, one_sided))
        elif about.is_log_uniform[i]:
            draws.append(lambda u, a=np.log(low), b=np.log(high): np.exp(a + (b - a) * u))
        else:
            draws.append(lambda u, a=low, b=high: a + (b - a) * u)
    return draws


def strength(null: float, size: float, one_sided: bool) -> Draw:
    """Return what draws a strength: half-normal, or normal, with one of several scales, all as probable."""
    below = np.mean(erf(SHARES[:, np.newaxis] / SCALES_OF_STRENGTH / np.sqrt(2.0)), axis=1)

    def draw(u: np.ndarray) -> np.ndarray:
        if one_sided:
            return null + size * np.interp(u, below, SHARES)
        return null + size * np.sign(u - 0.5) * np.interp(np.abs(2.0 * u - 1.0), below, SHARES)

    return draw


def page(table: pd.DataFrame, seed: int) -> str:
    """Return how far the log Bayes factors of both ways lie apart, as Markdown."""
    pairs = []
    for name, rows in table.groupby("campaign", sort=False):
        first = rows.iloc[0]
        for _, row in rows.iloc[1:].iterrows():
            by = [row[way] - first[way] for way in ("laplace", "nested")]
            error = float(np.hypot(row["nested_error"], first["nested_error"]))
            pairs.append((name, first["model"], row["model"], *by, error))
    apart = [abs(laplace - by_samples) for *_, laplace, by_samples, _ in pairs]
    sentence = "No campaign has two models to be compared."
    if pairs:
        error = np.median([p[-1] for p in pairs])
        sentence = (f"Of {len(pairs)} log Bayes factors the two ways differ by {np.median(apart):.2f} in the median, "
                    f"and by {max(apart):.2f} at most; the median error of nested sampling is "
                    f"{error:.2f}.")  # fmt: skip
    head = "| campaign | model | against | log Bayes factor, Laplace | nested sampling | its error |"
    lines = [f"| {name} | {other} | {best} | {a:.2f} | {b:.2f} | {e:.2f} |" for name, best, other, a, b, e in pairs]
    n = table["campaign"].nunique()
    return "\n".join([
        "# Laplace's evidence against nested sampling", "",
        f"{n} synthetic campaigns of the arm, seed {seed}; constants count as known exactly. {sentence}",
        "", head, "|---|---|---|---|---|---|", *lines, "",
        f"`python studies/calibration/nested.py FOLDER --seed {seed} --campaigns {n} --out results/nested` makes this "
        "page.", "",
    ])  # fmt: skip


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
