"""The document of a closed loop, and details.json: what of it is stored beside report.json."""

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from armid.estimation.identify import record_errors
from armid.estimation.identify_document import versions
from armid.loop.candidates import SHOWN_AS
from armid.loop.diagnose import SIGNIFICANCE, Diagnosis, Finding, Residuals
from armid.loop.figures import candidate_figure, record_figure
from armid.loop.missing_signal import Missing
from armid.loop.result import (
    EXPLAINED,
    NO_DISCREPANCY,
    PARTLY,
    TOO_ALIKE,
    UNEXPLAINED,
    ClosedLoop,
    Judgement,
    error_entry,
    finite,
)
from armid.loop.score_test import projected, rest_of
from armid.report.document import (
    ERROR_NOTE,
    MOST_RECORDS,
    Column,
    Document,
    Figure,
    Gallery,
    Listing,
    Part,
    Section,
    Sentences,
    Table,
    Text,
    changed,
    curve_entry,
    error_table,
    listing,
    made_section,
    records_note,
    rmse_text,
    table,
    value_text,
)
from armid.units import SHOWN, shown

TIMES = {"1": "", "direction": ", times the direction of motion,", "drive_effort": ", times the effort of the drive,"}
# A shift of a parameter by more than this share of its value, and of its interval, is told.
SHIFTED = 0.01
MOST_TOLD, MOST_PORTS = 3, 5
# A manoeuvre that separates rivals with a smaller chance is no advice.
HOPELESS = 0.2
# Smaller chances than this are all the same.
LEAST = 1e-12
# Candidates whose predicted change of the residual is drawn.
MOST_DRAWN = 4
# Figures that a page takes as they are stored: name -> title and caption.
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


def loop_document(
    report: Mapping[str, Any], details: Mapping[str, Any], svgs: Mapping[str, str], again: str
) -> Document:
    """Build the document of a closed loop from what is stored of it.

    report, details: report.json and details.json; for the others see `identify_document`.
    """
    figures = {name: (Figure(name, *FIGURES[name], svg=svg),) for name, svg in svgs.items()}
    unit = report["unit"]
    both = [(which, model, report["error"][model][which]) for which in ("train", "holdout")
            for model in ("before", "after")]  # fmt: skip
    errors = error_table("Errors", ["records", "model"], [row for row in both if row[-1] is not None], unit, ERROR_NOTE)
    parameters = parameter_table(report)
    each = [(r["file"], r["role"], model, r["error"][model]) for r in details.get("records", ())
            for model in ("before", "after")]  # fmt: skip
    note = records_note(len(each) // 2, details.get("n_records", 0))
    by_record = (error_table("Errors of each record", ["record", "role", "model"], each, unit, note),) if each else ()
    steps: tuple[Part, ...] = (step_table(report),) if report["steps"] else ()
    shifts = tuple(details.get("shifts", ()))
    missing = tuple(details.get("missing", ()))
    words = details.get("advice") or [", ".join(f"{k} = {v}" for k, v in a["manoeuvre"].items())
                                      for a in report["advice"]]  # fmt: skip
    advice = tuple(advice_sentence(a, text) for a, text in zip(report["advice"][:1], words, strict=False))
    sections = [
        Section("Error before and after", (errors, *by_record)),
        *([residual_section(details, unit)] if details else []),
        Section("Steps", steps or (Text("No effect was added."),)),
        Section("Parameters", (parameters, *([Sentences(shifts)] if shifts else []), *figures.get("parameters", ()))),
    ]
    if details:
        sections.append(candidates_section(details["candidates"], figures.get("ranking", ())))
        drawn = tuple(f for name in ("diagnosis", "autocorrelation", "missing") for f in figures.get(name, ()))
        told = [(f"{model.capitalize()}, {which} records", (details["diagnosis"][model] or {}).get(which))
                for model in ("before", "after") for which in ("train", "holdout")]  # fmt: skip
        tests = [Sentences(tuple(sentences), title) for title, sentences in told if sentences]
        unnamed = [Sentences(missing, "What is missing, without a name")] if missing else []
        sections.append(Section("Is what remains noise?", (*tests, *unnamed, *drawn)))
    elif figures:
        sections.append(Section("Figures", tuple(f for several in figures.values() for f in several)))
    if report["advice"]:
        sections.append(Section("The next record", (Sentences(advice), advice_table(report["advice"], words))))
    if details:
        sections.append(equations_section(details["equations"]))
    sections.append(made_section(details.get("made_by", {}), details.get("versions", {}), again))
    noise, name = shown(report["noise_rms"], unit)
    records = f", {details['n_records']} records" if details else ""
    return Document(
        report["campaign"], "Closed loop", f"What does the declared model of {report['plant']} lack on these records?",
        answer(report, details), tuple(sections), warning="" if details else OLD,
        facts=(f"Plant {report['plant']}{records}; noise {noise:.3g} {name} rms.",),
        main=(*steps, parameters, errors, Text(f"verdict: {report['verdict']}"),
              Sentences((*shifts, *missing, *advice))),
    )  # fmt: skip


def answer(report: Mapping[str, Any], details: Mapping[str, Any]) -> tuple[str, ...]:
    """Return verdict, error before and after, and which parameters are to be trusted."""
    verdict = VERDICTS.get(report["verdict"], report["verdict"])
    effects = f" ({' + '.join(report['effects'])})" if report["effects"] else ""
    first = f"{verdict}: {details['conclusion']}" if details else f"{verdict}{effects}."
    found = report["parameters"]["after"]
    sure = [f"{name} = {value_text(p)}" for name, p in found.items() if p["trusted"]]
    unsure = [name for name, p in found.items() if p["low"] is not None and not p["trusted"]]
    said = [f"To be trusted: {', '.join(sure)}."] if sure else []
    said += details.get("doubts") or ([f"Not to be trusted: {', '.join(unsure)}."] if unsure else [])
    return first, error_sentence(report), " ".join(said) or "No parameter was identified."


def error_sentence(report: Mapping[str, Any]) -> str:
    before, after = report["error"]["before"], report["error"]["after"]
    which, on = ("holdout", "the records held out") if after["holdout"] else ("train", "the train records")
    was, now = rmse_text(before[which], report["unit"]), rmse_text(after[which], report["unit"])
    noise, unit = shown(report["noise_rms"], report["unit"])
    alone = "" if which == "holdout" else "; no record was held out"
    if not report["effects"]:
        return f"Error on {on}: {now} {unit} RMSE, the noise is {noise:.3g} {unit}{alone}."
    return f"Error on {on}: {was} before, {now} {unit} RMSE after; the noise is {noise:.3g} {unit}{alone}."


def step_table(report: Mapping[str, Any]) -> Table:
    unit, rows, last = report["unit"], [], report["error"]["before"]
    for step in report["steps"]:
        own = [f"{name.partition('.')[2]} {value_text(p)}" for name, p in step["parameters"].items()
               if name.startswith(f"{step['effect']}.") and p["low"] is not None]  # fmt: skip
        errors = ["none" if step["error"][which] is None else
                  f"{rmse_text(last[which], unit)} -> {rmse_text(step['error'][which], unit)}"
                  for which in ("train", "holdout")]  # fmt: skip
        alternatives = ", ".join(step["alternatives"]) or "none"
        rows.append((step["effect"], step["port"], alternatives, *errors, "; ".join(own)))
        last = step["error"]
    name = SHOWN[unit][0]
    return table("Steps", ["effect", "port", "cannot be told from", f"train RMSE, {name}", f"holdout RMSE, {name}",
                           "parameters (95 % interval)"], rows)  # fmt: skip


def parameter_table(report: Mapping[str, Any]) -> Table:
    before, after = report["parameters"]["before"], report["parameters"]["after"]
    rows = [(name, value_text(before[name]) if name in before else "", value_text(p),
             "yes" if p["trusted"] else "fixed or not determined" if p["low"] is None else "no")
            for name, p in after.items()]  # fmt: skip
    return table("Parameters", ["parameter", "before", "after", "trusted"], rows, "Values with 95 % intervals.")


def residual_section(details: Mapping[str, Any], unit: str) -> Section:
    figures = []
    for i, record in enumerate(details["records"]):
        was, now = (rmse_text(record["error"][model], unit) for model in ("before", "after"))
        title = f"{record['file']} ({record['role']}), RMSE {was} to {now} {SHOWN[unit][0]}"
        figures.append(Figure(f"r{i}", title, "", partial(record_figure, record, unit)))
    text = (
        "Measured minus simulated speed; the grey band is two standard deviations of the noise. Slide to one end to "
        "see one model alone. Of long records the least and the largest sample of each short interval are drawn. "
    )
    gallery = Gallery(tuple(figures), "Measured minus simulated", "residuals")
    return Section("Residual of each record", (gallery,), text + records_note(len(figures), details["n_records"]))


def candidates_section(candidates: Mapping[str, Any], ranking: tuple[Figure, ...]) -> Section:
    columns = (
        Column("effect", "effect"), Column("drop", "fall of chi2 predicted [%]", ".3g", 100.0),
        Column("p", "chance from noise", ".2g"), Column("share", "left after projection [%]", ".3g", 100.0),
        Column("alignment", "alignment", ".3f"), Column("reached", "fall of chi2 reached [%]", ".3g", 100.0),
    )  # fmt: skip
    rows = [[c[column.key] for column in columns] for c in candidates["listed"]]
    drawn = tuple(
        Figure(f"c{i}", f"What {c['effect']} would explain", "",
               partial(candidate_figure, candidates["residual"], c["curve"], candidates["edges"]))
        for i, c in enumerate(candidates["listed"]) if c["curve"] is not None
    )  # fmt: skip
    text = (
        f"Train records end to end: {', '.join(candidates['files'])}. Grey: what the declared model leaves, whitened, "
        "and projected off the sensitivities to its parameters. Blue: the part of it that the leading candidates "
        "predict, projected alike."
    )
    parts: tuple[Part, ...] = table("Ranking", columns, rows, CANDIDATES_NOTE), *ranking, Gallery(drawn, wide=True)
    return Section("Candidates", parts, text)


def advice_table(advice: list[Mapping[str, Any]], words: list[str]) -> Table:
    rows = [(text, " and ".join(a["separates"]), a["power"]) for text, a in zip(words, advice, strict=True)]
    note = "Power: chance that one such record lets the right effect win, the lowest of all pairs."
    columns = ["manoeuvre", "separates", Column("power", "power [%]", ".0f", 100.0)]
    return table("Manoeuvres to record, best first", columns, rows, note)


def advice_sentence(best: Mapping[str, Any], words: str) -> str:
    names = " and ".join(best["separates"])
    if best["power"] < HOPELESS:
        return (f"No manoeuvre that this machine can make is likely to separate {names}: the best, {words}, has a "
                f"chance of {best['power']:.0%}.")  # fmt: skip
    return f"A record of this manoeuvre would separate {names} with a chance of {best['power']:.0%}: {words}."


def equations_section(equations: Mapping[str, str]) -> Section:
    before, after = equations["before"], equations["after"]
    if before == after:
        return Section("Equations", (listing("The declared model; nothing was added", before),))
    marked = Listing("Marked: what went (-) and what came (+)", changed(before, after))
    return Section("Equations before and after", (marked, listing("Before, alone", before, folded=True),
                                                  listing("After, alone", after, folded=True)))  # fmt: skip


def details_of(found: ClosedLoop) -> dict[str, Any]:
    """Return details as JSON can hold them, SI; the command adds `made_by`, its line and options.

    Of long records each curve keeps the samples that `thinned` chooses.
    """
    before, after = found.before, found.after
    records = [*record_entries(before.train, after.train), *record_entries(before.holdout, after.holdout)]
    diagnoses = {
        name: {"train": diagnosis_sentences(judged.diagnosis), "holdout": None if judged.holdout_diagnosis is None else
               diagnosis_sentences(judged.holdout_diagnosis)} for name, judged in (("before", before), ("after", after))
    }  # fmt: skip
    return {
        "versions": versions(),
        "conclusion": conclusion(found),
        "shifts": shift_sentences(before, after) if found.steps else [],
        "doubts": doubt_sentences(after),
        "diagnosis": diagnoses if found.steps else diagnoses | {"after": None},
        "missing": missing_sentences(found.missing) if found.missing is not None else [],
        "equations": {"before": str(before.model), "after": str(after.model)},
        "records": records[:MOST_RECORDS],
        "n_records": len(records),
        "candidates": candidates_of(found),
        "advice": [a.words for a in found.advice],
    }


def record_entries(before: Residuals | None, after: Residuals | None) -> list[dict[str, Any]]:
    if before is None or after is None:
        return []
    return [
        {
            "file": old.record.file, "role": old.record.role, "n_samples": len(was),
            "noise_rms": finite(old.record.noise.rms),
            "error": {"before": error_entry(record_errors(old, before.candidate)),
                      "after": error_entry(record_errors(new, after.candidate))},
            "curves": {"before": curve_entry(old.times, was), "after": curve_entry(new.times, now)},
        }
        for old, was, new, now in zip(before.replays, before.raw, after.replays, after.raw, strict=True)
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
    assert found.term is not None
    named = " + ".join(found.effects[:-1])
    lacking = f"The declared model lacks {named}, and beside it" if named else "The declared model lacks"
    dependence = found.term.dependence
    return (f"{lacking} something that no effect of the library explains: {found.effects[-1]} is an empirical curve "
            f"over {dependence.variable}{TIMES[dependence.factor]} at port {dependence.port}, which claims no physical "
            "name.")  # fmt: skip


def missing_sentences(missing: Missing) -> list[str]:
    ports = ", ".join(f"{s.port} {max(s.share, 0.0):.0%}" for s in missing.signals[:MOST_PORTS])
    said = [f"A signal without a form would remove this share of the residual at port: {ports}."]
    best = {d.variable: d for d in reversed(missing.dependences)}
    ranked = sorted(best.values(), key=lambda d: -d.share)[:MOST_PORTS]
    curves = ", ".join(f"{d.variable}{TIMES[d.factor]} at {d.port} {max(d.share, 0.0):.0%}" for d in ranked)
    return [*said, f"On what it depends, by the share that a curve predicts on parts left out of its fit: {curves}."]


def diagnosis_sentences(diagnosis: Diagnosis) -> list[str]:
    if not diagnosis.significant:
        return [f"What remains cannot be told from noise (least chance of {len(diagnosis.findings)} tests together "
                f"{diagnosis.p:.2g}, {SIGNIFICANCE:g} would be significant)."]  # fmt: skip

    def significant(kind: str) -> list[Finding]:
        """Return the significant findings of one kind, the largest first."""
        found = [f for f in diagnosis.of_kind(kind) if f.p * len(diagnosis.findings) < SIGNIFICANCE]
        return sorted(found, key=lambda f: -f.ratio)[:MOST_TOLD]

    said = [f"What remains is more than noise (chance {'below ' if diagnosis.p < LEAST else ''}"
            f"{max(diagnosis.p, LEAST):.2g})."]  # fmt: skip
    if not diagnosis.noise_known:
        said.append("No rest was recorded, so that the noise is not known: the residual is tested against itself.")
    wholes = {
        "size": "Its mean square is {ratio:.4g} times that of the noise.",
        "repeats": "Repeats of {where} agree with each other {ratio:.3g} times better than with the model (mean "
                   "squares, pure-error lack of fit).",
        "autocorrelation": "It is correlated in time: the Ljung-Box statistic over {where} is {ratio:.3g} times what "
                           "noise gives.",
    }  # fmt: skip
    said += [text.format(**vars(f)) for kind, text in wholes.items() for f in significant(kind)[:1]]
    for kind, name in (
        ("record", "record"),
        ("stage", "stage"),
        ("dependence", "variable"),
        ("frequency", "frequency"),
    ):
        places = ", ".join(f"{f.where} ({f.ratio:.3g} times the noise)" for f in significant(kind))
        said += [f"Where it is, by {name}: {places}."] if places else []
    return said


def shift_sentences(before: Judgement, after: Judgement) -> list[str]:
    later, said = {e.name: e for e in after.estimates}, []
    for old in before.estimates:
        new = later[old.name]
        if old.low is not None and old.value != new.value and abs(old.value - new.value) > SHIFTED * abs(new.value):
            share = (old.value - new.value) / abs(new.value) if new.value else np.inf
            said.append(f"{old.name} was biased by {share:+.2%}: {value_text(vars(old))} before, "
                        f"{value_text(vars(new))} after.")  # fmt: skip
    return said


def doubt_sentences(judged: Judgement) -> list[str]:
    reasons: dict[tuple[str, ...], list[str]] = {}
    for e in judged.estimates:
        # The heights of an empirical curve mean nothing one by one.
        if e.doubts and e.low is not None and not e.name.startswith(SHOWN_AS):
            reasons.setdefault(e.doubts, []).append(e.name)
    return [f"Not to be trusted: {', '.join(names)} ({'; '.join(why)})." for why, names in reasons.items()]
