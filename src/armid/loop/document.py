"""The verdict of the closed loop, in one sentence."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from armid.estimation.identify import record_errors
from armid.estimation.identify_document import MOST_RECORDS, curve_entry, versions
from armid.loop.advice import Advice
from armid.loop.candidates import SHOWN_AS
from armid.loop.diagnose import SIGNIFICANCE, Diagnosis, Finding, Residuals
from armid.loop.missing_signal import Missing
from armid.loop.result import (
    EXPLAINED,
    NO_DISCREPANCY,
    PARTLY,
    TOO_ALIKE,
    UNEXPLAINED,
    ClosedLoop,
    Estimate,
    Judgement,
    error_entry,
    finite,
)
from armid.loop.score_test import projected, rest_of
from armid.report.curves import candidate_drawing, residual_drawing
from armid.report.document import (
    ERROR_NOTE,
    Cell,
    Gallery,
    Grid,
    Listing,
    Page,
    Part,
    Section,
    Sentences,
    changed,
    drawing,
    drawings,
    error_cells,
    error_headers,
    grid,
    lines,
    made_section,
    number_cell,
    plain_grid,
    records_note,
    value_text,
)
from armid.units import SHOWN, shown

TIMES = {"1": "", "direction": ", times the direction of motion,", "drive_effort": ", times the effort of the drive,"}


def conclusion(found: ClosedLoop) -> str:
    """Return the verdict as one sentence."""
    if found.verdict == TOO_ALIKE:
        return doubtful(found)
    if found.term is not None:
        return partly_empirical(found)
    names = " + ".join(found.effects)
    return {
        NO_DISCREPANCY: "What the declared model leaves is noise: nothing is missing that these records could show.",
        EXPLAINED: f"The declared model lacked {names}; with it, what remains is noise on train and holdout.",
        PARTLY: f"The declared model lacks {names}, but a significant discrepancy remains: that is part of the story.",
        UNEXPLAINED: "The declared model lacks something, but no effect of the library earns its parameters.",
    }[found.verdict]


def doubtful(found: ClosedLoop) -> str:
    """Return which effects would do as well."""
    if found.refused is not None:
        rivals = [r.name for r in (*found.refused.alike, *found.refused.unlike)]
        return (f"The declared model lacks something, but on these records {len(rivals) + 1} effects would do nearly "
                f"as well ({found.refused.name}, {', '.join(rivals[:6])}): none is named.")  # fmt: skip
    said = [f"{s.effect} cannot be told from {' or '.join(s.alternatives)}" for s in found.steps if s.alternatives]
    said += [f"{s.effect} fits hardly better than {' or '.join(r.name for r in s.group.unlike)}"
             for s in found.steps if s.group.unlike]  # fmt: skip
    names = " + ".join(found.effects)
    said += [f"{names} fits hardly better than {' + '.join(r.names)}" for r in found.rivals]
    remains = "a significant discrepancy remains, and" if found.after.significant else "what remains is noise, but"
    return f"With {names} {remains} on these records {'; '.join(said)}."


def partly_empirical(found: ClosedLoop) -> str:
    """Return what the empirical term stands for."""
    assert found.term is not None
    named = " + ".join(found.effects[:-1])
    lacking = f"The declared model lacks {named}, and beside it" if named else "The declared model lacks"
    dependence = found.term.dependence
    return (f"{lacking} something that no effect of the library explains: {found.effects[-1]} is an empirical curve "
            f"over {dependence.variable}{TIMES[dependence.factor]} at port {dependence.port}, which claims no physical "
            "name.")  # fmt: skip


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


def markdown(found: ClosedLoop, figures: Sequence[str]) -> str:
    """Return report.md; figures: names of the files beside it."""
    value, unit = shown(found.noise_rms, found.campaign.unit)
    lines = [
        f"# {found.campaign.name}: what the declared model lacks", "", f"**{found.verdict}.** {conclusion(found)}", "",
        f"Plant {found.campaign.plant.name}, {len(found.campaign.train)} records to train, "
        f"{len(found.campaign.holdout)} held out; noise {value:.3g} {unit} rms.",
    ]  # fmt: skip
    lines += section("Steps", table(step_headers(found), step_rows(found)) if found.steps else ["No effect was added."])
    lines += section("Errors", table(report_error_headers(found), error_rows(found)))
    lines += section("Parameters", table(["parameter", "before", "after", "trusted"], parameter_rows(found)))
    said = shift_sentences(found.before, found.after) if found.steps else []
    lines += ["", *bullets(said + doubt_sentences(found.after))]
    lines += section("Before", bullets(diagnosis_sentences(found.before.diagnosis)))
    if found.steps:
        lines += section("After, on the train records", bullets(diagnosis_sentences(found.after.diagnosis)))
    if found.after.holdout_diagnosis is not None:
        lines += section("After, on the records held out", bullets(diagnosis_sentences(found.after.holdout_diagnosis)))
    if found.missing is not None:
        lines += section("What is missing, without a name", bullets(missing_sentences(found.missing)))
    headers = ["effect", "predicted fall of chi2", "chance from noise"]
    lines += section("Leading candidates", table(headers, score_rows(found)))
    if found.advice:
        lines_of_advice = [advice_sentence(found.advice[0]), ""]
        rows = [[a.words, " and ".join(a.separates), f"{a.power:.0%}"] for a in found.advice]
        lines += section("The next record", lines_of_advice + table(["manoeuvre", "separates", "power"], rows))
    lines += section("Figures", [line for name in figures for line in (f"![{name}]({name})", "")])
    return "\n".join(lines).rstrip() + "\n"


def section(title: str, lines: Sequence[str]) -> list[str]:
    """Return a section with its heading."""
    return ["", f"## {title}", "", *lines]


def bullets(sentences: Sequence[str]) -> list[str]:
    """Return sentences as a list."""
    return [f"- {s}" for s in sentences]


def table(headers: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Return a table."""
    return [f"| {' | '.join(row)} |" for row in (headers, ["---"] * len(headers), *rows)]


def report_error_headers(found: ClosedLoop) -> list[str]:
    """Return the headers of the table of errors."""
    return ["records", "model", f"RMSE, {SHOWN[found.campaign.unit][0]}", "NRMSE", "chi2/sample", "S", "S1", "S2"]


def error_rows(found: ClosedLoop) -> list[list[str]]:
    """Return errors on train and holdout, before and after."""
    rows = []
    for name, judged in (("before", found.before), ("after", found.after)):
        for records, e in (("train", judged.train_error), ("holdout", judged.holdout_error)):
            if e is None:
                continue
            chi2 = "unknown" if e.chi2_per_sample is None else f"{e.chi2_per_sample:.4g}"
            rmse = f"{shown(e.rmse, found.campaign.unit)[0]:.4g}"
            rows.append([records, name, rmse, f"{e.nrmse:.3%}", chi2, f"{e.s:.4f}", f"{e.s1:.4f}", f"{e.s2:.4f}"])
    return rows


def score_rows(found: ClosedLoop, most: int = 10) -> list[list[str]]:
    """Return the candidates that scored best at the declared model."""
    scores = found.search.scores_at(found.before.fit)[:most]
    return [[s.key.public, f"{s.drop:.4g}", f"{s.p:.2g}"] for s in scores]


# Candidates whose predicted change of the residual is drawn.
MOST_DRAWN = 4


def details_of(found: ClosedLoop, made_by: Mapping[str, Any]) -> dict[str, Any]:
    """Return details as JSON can hold them, SI; made_by: the command and its options.

    Of long records each curve keeps the samples that `thinned` chooses.
    """
    records = [r for name in ("train", "holdout") for r in records_of(getattr(found.before, name),
                                                                      getattr(found.after, name))]  # fmt: skip
    return {
        "made_by": dict(made_by),
        "versions": versions(),
        "conclusion": conclusion(found),
        "shifts": shift_sentences(found.before, found.after) if found.steps else [],
        "doubts": doubt_sentences(found.after),
        "diagnosis": {
            "before": finding_entry(found.before),
            "after": finding_entry(found.after) if found.steps else None,
        },
        "missing": missing_sentences(found.missing) if found.missing is not None else [],
        "equations": {"before": str(found.before.model), "after": str(found.after.model)},
        "records": records[:MOST_RECORDS],
        "n_records": len(records),
        "candidates": candidates_of(found),
        "advice": [a.words for a in found.advice],
    }


def finding_entry(judged: Judgement) -> dict[str, list[str] | None]:
    """Return what was found in the residuals of a model, on train and holdout."""
    unseen = judged.holdout_diagnosis
    return {"train": diagnosis_sentences(judged.diagnosis),
            "holdout": None if unseen is None else diagnosis_sentences(unseen)}  # fmt: skip


def records_of(before: Residuals | None, after: Residuals | None) -> list[dict[str, Any]]:
    """Return each record with its errors and residuals before and after."""
    if before is None or after is None:
        return []
    pairs = zip(before.replays, before.raw, after.replays, after.raw, strict=True)
    return [
        {
            "file": old.record.file, "role": old.record.role, "n_samples": len(was),
            "noise_rms": finite(old.record.noise.rms),
            "error": {"before": error_entry(record_errors(old, before.candidate)),
                      "after": error_entry(record_errors(new, after.candidate))},
            "curves": {"before": curve_entry(old.times, was), "after": curve_entry(new.times, now)},
        }
        for old, was, new, now in pairs
    ]  # fmt: skip


def candidates_of(found: ClosedLoop) -> dict[str, Any]:
    """Return the candidates at the declared model, best first, with the projected sensitivities of the scores.

    drop: predicted fall of chi2 as a share of it; reached: that of the full fit with the effect alone, null where there
    was none. Curves are whitened, in standard deviations of the noise, against the number of the sample.
    """
    start = found.before.fit
    reached: dict[str, float] = {}
    for fit in found.search.of_size(1):
        name = fit.active[0].public
        reached[name] = max(reached.get(name, 0.0), 1.0 - fit.chi2 / start.chi2)
    listed: list[dict[str, Any]] = []
    for score in found.search.scores_at(start):
        name = score.key.public
        if any(entry["effect"] == name for entry in listed):
            continue
        behind = projected(start, score.key, found.library)
        drawn = len(listed) < MOST_DRAWN
        listed.append({
            "effect": name, "drop": finite(score.drop / start.chi2), "p": finite(score.p),
            "reached": finite(reached.get(name)), "share": finite(behind.share), "alignment": finite(behind.alignment),
            "curve": curve_entry(np.arange(len(behind.change), dtype=float), behind.change) if drawn else None,
        })  # fmt: skip
    rest = rest_of(start)
    edges = found.before.train.data.edges
    return {
        "listed": listed,
        "residual": curve_entry(np.arange(len(rest), dtype=float), rest),
        "edges": [int(e) for e in edges],
        "files": [r.record.file for r in found.before.train.replays],
    }


def errors_section(report: Mapping[str, Any], details: Mapping[str, Any]) -> Section:
    """Return errors on train and holdout, and of each record."""
    unit = report["unit"]
    both = [(which, model, report["error"][model][which]) for which in ("train", "holdout")
            for model in ("before", "after")]  # fmt: skip
    rows = [[Cell(which), Cell(model), *error_cells(e, unit)] for which, model, e in both if e is not None]
    parts = [grid("Errors", ["records", "model", *error_headers(unit)], rows, ERROR_NOTE)]
    if details:
        parts.append(record_errors_grid(details, unit))
    return Section("Error before and after", tuple(parts))


def record_errors_grid(details: Mapping[str, Any], unit: str) -> Grid:
    """Return the errors of each record."""
    rows = [[Cell(r["file"]), Cell(r["role"]), Cell(model), *error_cells(r["error"][model], unit)]
            for r in details["records"] for model in ("before", "after")]  # fmt: skip
    note = records_note(len(details["records"]), details["n_records"])
    return grid("Errors of each record", ["record", "role", "model", *error_headers(unit)], rows, note)


def steps_grid(report: Mapping[str, Any]) -> Grid:
    """Return the effects that were added, with the error after each."""
    unit = report["unit"]
    name, factor = SHOWN[unit]
    rows = [[Cell("none: the declared model"), Cell(""), Cell(""), *rmse_cells(report["error"]["before"], factor),
             Cell("")]]  # fmt: skip
    for step in report["steps"]:
        own = [f"{name.partition('.')[2]} {value_text(p)}" for name, p in step["parameters"].items()
               if name.startswith(f"{step['effect']}.") and p["low"] is not None]  # fmt: skip
        doubt = ", ".join(step["alternatives"]) or "none"
        rows.append([Cell(step["effect"]), Cell(step["port"]), Cell(doubt), *rmse_cells(step["error"], factor),
                     Cell("; ".join(own))])  # fmt: skip
    headers = ["effect", "port", "cannot be told from", f"train RMSE [{name}]", f"holdout RMSE [{name}]",
               "parameters (95 % interval)"]  # fmt: skip
    return grid("Effects added, in order, and the error with each", headers, rows)


def rmse_cells(error: Mapping[str, Any], factor: float) -> list[Cell]:
    """Return the errors on train and holdout; a campaign may hold none out."""
    return [Cell("none") if error[which] is None else number_cell(error[which]["rmse"], ".4g", factor)
            for which in ("train", "holdout")]  # fmt: skip


def parameters_grid(report: Mapping[str, Any]) -> Grid:
    """Return each parameter before and after."""
    before, after = report["parameters"]["before"], report["parameters"]["after"]
    rows = [[name, value_text(before[name]) if name in before else "", value_text(p),
             "yes" if p["trusted"] else "fixed or not determined" if p["low"] is None else "no"]
            for name, p in after.items()]  # fmt: skip
    return plain_grid("Values with 95 % intervals", ["parameter", "before", "after", "trusted"], rows)


def advice_grid(report: Mapping[str, Any], details: Mapping[str, Any]) -> Grid:
    """Return the manoeuvres that would tell rivals apart."""
    words = details["advice"] if details else [", ".join(f"{k} = {v}" for k, v in a["manoeuvre"].items())
                                               for a in report["advice"]]  # fmt: skip
    rows = [[Cell(text), Cell(" and ".join(a["separates"])), number_cell(a["power"], ".0f", 100.0)]
            for text, a in zip(words, report["advice"], strict=True)]  # fmt: skip
    note = "Power: chance that one such record lets the right effect win, the lowest of all pairs."
    return grid("Manoeuvres to record, best first", ["manoeuvre", "separates", "power [%]"], rows, note)


FIGURES = {
    "parameters": ("Parameters before and after", "Values with 95 % intervals; open marks are not to be trusted."),
    "ranking": ("Candidates for the first effect", "Bars: fall of chi2 that the score predicts. Diamonds: that which a "
                "full fit with this effect alone reached."),
    "diagnosis": ("Where the discrepancy is", "Mean square of the residual in units of the noise's, part by part, "
                  "before and after; 1 is noise."),
    "autocorrelation": ("Correlation in time", "Autocorrelation of the whitened residual of the train records, before "
                        "and after; the band holds 95 % of what white noise gives."),
    "missing": ("The missing signal without a form", "What would have to be added at each port, and against what it "
                "depends."),
}  # fmt: skip
VERDICTS = {
    "no_discrepancy": "Only noise is left", "explained": "Explained", "partly_explained": "Partly explained",
    "unexplained": "Unexplained", "cannot_tell_apart": "Effects cannot be told apart",
}  # fmt: skip
OLD = (
    "details.json is not in this folder: an earlier version of armid wrote it, so residuals, equations, candidates, "
    "settings and the command are not on this page; the same `armid close-loop` again writes them."
)
CANDIDATES_NOTE = (
    "At the declared model. Fall of chi2 predicted: were the records linear in the effect. Left after projection: the "
    "share of the effect's sensitivity (by length) that the free parameters cannot absorb. Alignment: cosine between "
    "that and what the parameters leave of the residual; its square is the share of the residual that the effect "
    "could remove with an amplitude out of all bounds. Reached: by a full fit with this effect alone."
)


def loop_page(report: Mapping[str, Any], details: Mapping[str, Any], svgs: Mapping[str, str], again: str) -> Page:
    """Return the page. details: empty where there are none; svgs: name -> SVG of FIGURES; again: makes it again."""
    figures = drawings(svgs, FIGURES)
    sections = [errors_section(report, details)]
    if details:
        sections.append(residual_section(report, details))
    none_added = Sentences(("No effect was added.",))
    sections.append(Section("Steps", (steps_grid(report) if report["steps"] else none_added,)))
    parts: list[Part] = [parameters_grid(report)]
    if details:
        parts.append(Sentences((*details["shifts"], *details["doubts"])))
    sections.append(Section("Parameters", (*parts, *some(figures, "parameters"))))
    if details:
        sections.append(candidates_section(details["candidates"], some(figures, "ranking")))
        sections.append(remains_section(details, some(figures, "diagnosis", "autocorrelation", "missing")))
    else:
        sections += [Section("Figures", some(figures, *FIGURES))] if figures else []
    if report["advice"]:
        sections.append(Section("The next record", (advice_grid(report, details),)))
    if details:
        sections.append(equations_section(details["equations"]))
    made = details.get("made_by", {}), details.get("versions", {})
    sections.append(made_section(*made, again))
    question = f"What does the declared model of {report['plant']} lack on these records?"
    return Page(report["campaign"], "Closed loop", question, answer(report, details), tuple(sections),
                warning="" if details else OLD)  # fmt: skip


def some(figures: Mapping[str, Any], *names: str) -> tuple[Any, ...]:
    """Return the figures of these names that there are."""
    return tuple(figures[name] for name in names if name in figures)


def answer(report: Mapping[str, Any], details: Mapping[str, Any]) -> tuple[str, ...]:
    """Return verdict, error before and after, and which parameters are to be trusted."""
    verdict = VERDICTS.get(report["verdict"], report["verdict"])
    effects = f" ({' + '.join(report['effects'])})" if report["effects"] else ""
    first = f"{verdict}: {details['conclusion']}" if details else f"{verdict}{effects}."
    found = report["parameters"]["after"]
    fitted = {name: p for name, p in found.items() if p["low"] is not None or p["trusted"]}
    sure = [name for name, p in fitted.items() if p["trusted"]]
    unsure = [name for name in fitted if name not in sure]
    words = [f"To be trusted: {', '.join(f'{n} = {value_text(found[n])}' for n in sure)}."] if sure else []
    words += [f"Not to be trusted: {', '.join(unsure)}."] if unsure else []
    return first, error_sentence(report), " ".join(words) or "No parameter was identified."


def error_sentence(report: Mapping[str, Any]) -> str:
    """Return the error before and after, on the records held out where there are any."""
    before, after = report["error"]["before"], report["error"]["after"]
    which, on = ("holdout", "the records held out") if after["holdout"] else ("train", "the train records")
    was, unit = shown(before[which]["rmse"], report["unit"])
    now, noise = (shown(value, report["unit"])[0] for value in (after[which]["rmse"], report["noise_rms"]))
    alone = "" if which == "holdout" else "; no record was held out"
    if not report["effects"]:
        return f"Error on {on}: {now:.4g} {unit} RMSE, the noise is {noise:.3g} {unit}{alone}."
    return f"Error on {on}: {was:.4g} before, {now:.4g} {unit} RMSE after; the noise is {noise:.3g} {unit}{alone}."


def residual_section(report: Mapping[str, Any], details: Mapping[str, Any]) -> Section:
    """Return the residual of each record before and after, one over the other."""
    unit, factor = SHOWN[report["unit"]]
    made = []
    for i, record in enumerate(details["records"]):
        was, now = (factor * record["error"][model]["rmse"] for model in ("before", "after"))
        title = f"{record['file']} ({record['role']}), RMSE {was:.3g} to {now:.3g} {unit}"
        made.append(drawing(title, residual_drawing(record["curves"], record["noise_rms"], unit, factor), f"r{i}-"))
    gallery = Gallery(tuple(made), "Measured minus simulated")
    words = (
        "Measured minus simulated speed; the grey band is two standard deviations of the noise. Slide to one end to "
        "see one model alone. Of long records the least and the largest sample of each short interval are drawn. "
    )
    return Section("Residual of each record", (gallery,), words + records_note(len(made), details["n_records"]))


def candidates_section(candidates: Mapping[str, Any], figures: tuple[Any, ...]) -> Section:
    """Return the ranking, and what the leading candidates would do to the residual."""
    rows = [[Cell(c["effect"]), number_cell(c["drop"], ".3g", 100.0), number_cell(c["p"], ".2g"),
             number_cell(c["share"], ".3g", 100.0), number_cell(c["alignment"], ".3f"),
             number_cell(c["reached"], ".3g", 100.0)] for c in candidates["listed"]]  # fmt: skip
    headers = ["effect", "fall of chi2 predicted [%]", "chance from noise", "left after projection [%]", "alignment",
               "fall of chi2 reached [%]"]  # fmt: skip
    drawn = [
        drawing(f"What {c['effect']} would explain", candidate_drawing(candidates["residual"], c["curve"],
                candidates["edges"]), f"c{i}-")
        for i, c in enumerate(candidates["listed"]) if c["curve"] is not None
    ]  # fmt: skip
    words = (
        f"Train records end to end: {', '.join(candidates['files'])}. Grey: what the declared model leaves, whitened, "
        "and projected off the sensitivities to its parameters. Blue: the part of it that the leading candidates "
        "predict, projected alike."
    )
    return Section("Candidates", (grid("Ranking", headers, rows, CANDIDATES_NOTE), *figures, *drawn), words)


def remains_section(details: Mapping[str, Any], figures: tuple[Any, ...]) -> Section:
    """Return what the tests of the residuals say."""
    parts: list[Part] = []
    for model in ("before", "after"):
        for which in ("train", "holdout"):
            said = (details["diagnosis"][model] or {}).get(which)
            if said:
                parts.append(Sentences(tuple(said), f"{model.capitalize()}, {which} records"))
    if details["missing"]:
        parts.append(Sentences(tuple(details["missing"]), "What is missing, without a name"))
    return Section("Is what remains noise?", (*parts, *figures))


def equations_section(equations: Mapping[str, str]) -> Section:
    """Return the model after the last step, marked where it differs from the declared one."""
    before, after = equations["before"], equations["after"]
    if before == after:
        return Section("Equations", (Listing("The declared model; nothing was added", lines(before)),))
    marked = Listing("Marked: what went (-) and what came (+)", changed(before, after))
    return Section("Equations before and after", (marked, Listing("Before, alone", lines(before), folded=True),
                                                  Listing("After, alone", lines(after), folded=True)))  # fmt: skip
