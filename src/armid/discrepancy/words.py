"""What the closed loop found, in sentences."""

import numpy as np

from armid.discrepancy.advise import Advice
from armid.discrepancy.conclusion import TIMES, conclusion
from armid.discrepancy.diagnose import SIGNIFICANCE, Diagnosis, Finding
from armid.discrepancy.estimates import Estimate
from armid.discrepancy.missing import Missing
from armid.discrepancy.names import SHOWN_AS
from armid.discrepancy.result import ClosedLoop, Judgement
from armid.display import SHOWN, shown

# A shift of a parameter by more than this share of its value, and of its interval, is told.
SHIFTED = 0.01
MOST_TOLD, MOST_PORTS = 3, 5
# A manoeuvre that separates rivals with a smaller chance is no advice.
HOPELESS = 0.2
# Smaller chances than this are all the same.
LEAST = 1e-12


def missing_sentences(missing: Missing) -> list[str]:
    """Return at which port the missing signal is, and on what it depends."""
    ports = ", ".join(f"{s.port} {max(s.share, 0.0):.0%}" for s in missing.signals[:MOST_PORTS])
    said = [f"A signal without a form would remove this share of the residual at port: {ports}."]
    best = {d.variable: d for d in reversed(missing.dependences)}
    ranked = sorted(best.values(), key=lambda d: -d.share)[:MOST_PORTS]
    curves = ", ".join(f"{d.variable}{TIMES[d.factor]} at {d.port} {max(d.share, 0.0):.0%}" for d in ranked)
    return [*said, f"On what it depends, by the share that a curve predicts on parts left out of its fit: {curves}."]


def diagnosis_sentences(diagnosis: Diagnosis) -> list[str]:
    """Return whether there is a discrepancy and where, one sentence each."""
    if not diagnosis.significant:
        return [f"What remains cannot be told from noise (least chance of {len(diagnosis.findings)} tests together "
                f"{diagnosis.p:.2g}, {SIGNIFICANCE:g} would be significant)."]  # fmt: skip
    bound = "below " if diagnosis.p < LEAST else ""
    said = [f"What remains is more than noise (chance {bound}{max(diagnosis.p, LEAST):.2g})."]
    if not diagnosis.noise_known:
        said.append("No rest was recorded, so that the noise is not known: the residual is tested against itself.")
    said += [told(f) for kind in ("size", "repeats", "autocorrelation") for f in striking(diagnosis, kind, 1)]
    for kind in ("record", "stage", "variable", "frequency"):
        found = striking(diagnosis, "dependence" if kind == "variable" else kind, MOST_TOLD)
        places = ", ".join(f"{f.where} ({f.ratio:.3g} times the noise)" for f in found)
        said += [f"Where it is, by {kind}: {places}."] if found else []
    return said


def striking(diagnosis: Diagnosis, kind: str, most: int) -> list[Finding]:
    """Return the significant findings of one kind, the largest first."""
    found = [f for f in diagnosis.of_kind(kind) if f.p * len(diagnosis.findings) < SIGNIFICANCE]
    return sorted(found, key=lambda f: -f.ratio)[:most]


def told(finding: Finding) -> str:
    """Return the sentence of a finding about the residual as a whole."""
    return {
        "size": f"Its mean square is {finding.ratio:.4g} times that of the noise.",
        "repeats": f"Repeats of {finding.where} agree with each other {finding.ratio:.3g} times better than with the "
        "model (mean squares, pure-error lack of fit).",
        "autocorrelation": f"It is correlated in time: the Ljung-Box statistic over {finding.where} is "
        f"{finding.ratio:.3g} times what noise gives.",
    }[finding.kind]


def shift_sentences(before: Judgement, after: Judgement) -> list[str]:
    """Return what the missing effects had bent: the declared parameters that moved."""
    later = {e.name: e for e in after.estimates}
    said = []
    for old in before.estimates:
        new = later[old.name]
        if old.low is not None and old.value != new.value and abs(old.value - new.value) > SHIFTED * abs(new.value):
            bent = (old.value - new.value) / abs(new.value) if new.value else np.inf
            said.append(f"{old.name} was bent by {bent:+.2%}: {text_of(old)} before, {text_of(new)} after.")
    return said


def text_of(estimate: Estimate) -> str:
    """Return a value with its interval in units that people read."""
    value, name = shown(estimate.value, estimate.unit)
    unit = "" if name == "1" else f" {name}"
    if estimate.low is None or estimate.high is None:
        return f"{value:.5g}{unit}"
    low, high = shown(estimate.low, estimate.unit)[0], shown(estimate.high, estimate.unit)[0]
    return f"{value:.5g}{unit} ({low:.5g} to {high:.5g})"


def doubt_sentences(judged: Judgement) -> list[str]:
    """Return why parameters are not to be trusted."""
    reasons: dict[tuple[str, ...], list[str]] = {}
    for e in judged.estimates:
        # The heights of an empirical curve mean nothing one by one.
        if e.doubts and e.low is not None and not e.name.startswith(SHOWN_AS):
            reasons.setdefault(e.doubts, []).append(e.name)
    return [f"Not to be trusted: {', '.join(names)} ({'; '.join(why)})." for why, names in reasons.items()]


def arrow(before: float | None, after: float | None, unit: str) -> str:
    """Return an error before and after, in the unit that people read."""
    if before is None or after is None:
        return "none"
    return f"{shown(before, unit)[0]:.4g} -> {shown(after, unit)[0]:.4g}"


def step_rows(found: ClosedLoop) -> list[list[str]]:
    """Return the rows of the table of steps: effect, port, alternatives, errors before and after, parameters."""
    rows, last = [], found.before
    for step in found.steps:
        own = [e for e in step.after.estimates if e.name.startswith(f"{step.effect}.") and e.low is not None]
        rows.append([
            step.effect, step.port, ", ".join(step.alternatives) or "none",
            arrow(last.train_error.rmse, step.after.train_error.rmse, found.campaign.unit),
            arrow(holdout_rmse(last), holdout_rmse(step.after), found.campaign.unit),
            "; ".join(f"{e.name.partition('.')[2]} {text_of(e)}" for e in own),
        ])  # fmt: skip
        last = step.after
    return rows


def holdout_rmse(judged: Judgement) -> float | None:
    """Return the error on the records held out, None where there are none."""
    return None if judged.holdout_error is None else judged.holdout_error.rmse


def step_headers(found: ClosedLoop) -> list[str]:
    """Return the headers of the table of steps."""
    unit = SHOWN[found.campaign.unit][0]
    return ["effect", "port", "or", f"train RMSE, {unit}", f"holdout RMSE, {unit}", "parameters (95 % interval)"]


def parameter_rows(found: ClosedLoop) -> list[list[str]]:
    """Return the rows of the table of parameters before and after."""
    before = {e.name: e for e in found.before.estimates}
    return [
        [e.name, text_of(before[e.name]) if e.name in before else "", text_of(e),
         "fixed" if e.low is None and "declared" in e.doubts[0] else "yes" if e.trusted else "no"]
        for e in found.after.estimates
    ]  # fmt: skip


def remarks(found: ClosedLoop) -> list[str]:
    """Return everything that a reader must know, one sentence each."""
    said = [conclusion(found)]
    if found.steps:
        said += shift_sentences(found.before, found.after)
    if found.missing is not None:
        said += missing_sentences(found.missing)
    said += doubt_sentences(found.after)
    return [*said, *(advice_sentence(a) for a in found.advice[:1])]


def advice_sentence(best: Advice) -> str:
    """Return what the most telling manoeuvre would do."""
    names = " and ".join(best.separates)
    if best.power < HOPELESS:
        return (f"No manoeuvre that this machine can make is likely to separate {names}: the best, {best.words}, has a "
                f"chance of {best.power:.0%}.")  # fmt: skip
    return f"A record of this manoeuvre would separate {names} with a chance of {best.power:.0%}: {best.words}."
