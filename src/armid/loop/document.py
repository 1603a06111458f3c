"""The document of a closed loop, and details.json: what is stored next to report.json."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np

from armid.errors import ArmidError
from armid.estimation.corrections import rms
from armid.estimation.identify import versions_of
from armid.estimation.identify_document import PACKAGES_OF_IDENTIFY
from armid.estimation.information import NORMAL_95
from armid.inference.candidates import ERROR_OF
from armid.inference.carry_over import missed_sentences, over_noise
from armid.inference.checks import Finding, Residuals, time_in_words
from armid.inference.decisions import EXPLAINS, LISTED, MENTIONED, OVER_NOISE, SIGNIFICANCE
from armid.inference.infer import Inference, sentence_of
from armid.inference.kinds.hypothesis import words
from armid.inference.kinds.missing_signal import Missing
from armid.inference.model import Fit
from armid.inference.posterior import UNSEEN
from armid.loop.figures import figures_of, record_figure
from armid.loop.result import (
    REPORT_VERSION,
    ClosedLoop,
    Judgement,
    Verdict,
    fault_sentence,
    record_entries,
    report_of,
)
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
    error_table,
    listing,
    made_section,
    may_be_inputs,
    moved_text,
    noise_text,
    others_text,
    plain,
    records_note,
    rmse_text,
    stored_figures,
    table,
    titled,
    value_text,
)
from armid.report.result import Parts
from armid.units import scale_of, shown

TIMES_IN_WORDS = {
    "1": "",
    "direction": ", times the direction of motion,",
    "drive_effort": ", times the effort of the drive,",
}
# How many times what was found of a strength a search for it may reach.
SEARCHED_TO = 4.0
# A shift of a parameter by more than this share of its value, and of its interval, is listed.
SHIFTED = 0.01
MOST_FINDINGS, MOST_PORTS, MOST_EXACT, MOST_DRAWN = 3, 5, 5, 6
# A manoeuvre that separates rivals with a smaller chance is not advice.
WEAK = 0.2
# Smaller chances than this are all the same.
LEAST_CHANCE = 1e-12
# Smallest share that is shown: a smaller one is rounded to 0 %.
LEAST_SHARE = 0.005
# Figures that a page takes as they are stored: name -> title and caption.
FIGURES = {
    "parameters": ("Parameters before and after", "Deviation from the value after, in % of it, with 95 % intervals. "
                   "Open marks are not to be trusted; a dashed line is the true value, where it is known."),
    "motion": ("Measured and simulated motion", "Grey: measured. The coloured lines are the model before and after."),
    "probabilities": ("How probable each is", "Of all models that were fitted: the share of those that hold it. A name "
                      "counts only in models without anything unknown."),
    "intervals": ("Each parameter by model", "Values with 95 % intervals by the most probable models, were each true, "
                  "and over all of them."),
    "diagnosis": ("Where the discrepancy is", "Mean square of the residual in units of the noise's, part by part, "
                  "before and after; 1 is noise."),
    "against": ("Residual against speed and position", "Measured minus simulated of the train records, a point a "
                "sample; the lines are means over equally many samples."),
    "autocorrelation": ("Correlation in time", "Autocorrelation of the whitened residual of the train records, before "
                        "and after; the band holds 95 % of what white noise gives."),
    "missing": ("The missing signal without a form", "What would have to be added at each port, and against what it "
                "depends."),
}  # fmt: skip
VERDICTS: dict[Verdict, str] = {
    "no_discrepancy": "Only noise is left", "explained": "Explained", "partly_explained": "Partly explained",
    "unexplained": "Unexplained", "cannot_tell_apart": "Effects cannot be told apart",
    "does_not_carry_over": "Does not carry over", "record_disagrees": "A record disagrees",
    "implausible_records": "Records look wrong",
}  # fmt: skip
PROBABILITIES_NOTE = (
    "Share of the posterior. A name counts only in models without something unknown. In its place: effects that may "
    "explain the records instead."
)

UNNAMED = "the plant has no port for them, a free parameter does the same, or they were left out by name."


def loop_document(
    report: Mapping[str, Any], details: Mapping[str, Any], svgs: Mapping[str, str], again: str
) -> Document:
    """Build the document of a closed loop from what is stored of it.

    report, details: report.json and details.json; for the others see `identify_document`.
    """
    if report.get("version") != REPORT_VERSION:
        raise ArmidError(f"report.json of {report['campaign']} was written by another version of armid: the same "
                         "`armid close-loop` again is expected")  # fmt: skip
    unit, drawn = report["unit"], partial(stored_figures, FIGURES, svgs)
    both = [(which, model, report["error"][model][which]) for which in ("train", "holdout")
            for model in ("before", "after")]  # fmt: skip
    errors = error_table("Errors", ["records", "model"], [row for row in both if row[-1] is not None], unit, ERROR_NOTE)
    parameters, chances = parameter_table(report), probability_table(report)
    steps: tuple[Part, ...] = (step_table(report),) if report["steps"] else ()
    steps += (Sentences((details["declared_by"],)),) if details.get("declared_by") else ()
    shifts = (*details["suspects"], *details["shifts"])
    together = tuple(f"{sentence[0].upper()}{sentence[1:]}." for sentence in report["known_together"])
    wide = [f"{name}: {'; '.join(p['causes'])}." for name, p in report["parameters"]["after"].items() if p["causes"]]
    missing, words = tuple(details["missing"]), details["advice"]
    advice = tuple(advice_sentence(a, text) for a, text in zip(report["advice"][:1], words, strict=False))
    advice += tuple(report["next_steps"])
    tests = {f"{model.capitalize()}, {which} records": (details["diagnosis"][model] or {}).get(which)
             for model in ("before", "after") for which in ("train", "holdout")}  # fmt: skip
    sections = (
        Section("What is missing", (chances, *drawn("probabilities", "intervals"))),
        Section("Error before and after", (errors,)),
        Section("Motion", drawn("motion")),
        residual_section(details, unit),
        Section("Steps", steps or (Text("No effect was added."),)),
        Section("Parameters", (
            parameters, *titled({"What makes the intervals wide": wide, "": (*shifts, *together)}),
            *drawn("parameters"),
        )),
        Section("Is what remains noise?", (
            *titled(tests | {"What is missing, without a name": missing}),
            *drawn("diagnosis", "against", "autocorrelation", "missing"),
        )),
        Section("Models that were fitted", (log_table(report),)),
        Section("The next record", (
            *titled({"": advice}), *((advice_table(report["advice"], words),) if report["advice"] else ()),
        )),
        equations_section(details["equations"]),
        made_section(details.get("made_by", {}), details["versions"], again),
    )  # fmt: skip
    noise, name = shown(report["noise_rms"], unit)
    return Document(
        report["campaign"], "Closed loop", f"What does the declared model of {report['plant']} lack on these records?",
        answer(report, details), tuple(s for s in sections if s.parts),
        facts=(f"Plant {report['plant']}, {details['n_files']} records; noise {noise:.3g} {name} rms.",),
        main=(chances, *steps, parameters, errors, Text(f"verdict: {report['verdict']}"),
              Sentences((*shifts, *missing, *advice))),
    )  # fmt: skip


def answer(report: Mapping[str, Any], details: Mapping[str, Any]) -> tuple[str, ...]:
    """Return what is probable, the verdict, error before and after, and which parameters are to be trusted."""
    second = f"{details['headline']}: {details['conclusion']}"
    parameters = report["parameters"]["after"]
    sure = [f"{name} = {value_text(p)}" for name, p in parameters.items() if p["trusted"]]
    exact = report["taken_as_exact"]
    others = len(exact) - MOST_EXACT
    names = f"{', '.join(exact[:MOST_EXACT])} and {others} others" if others > 1 else ", ".join(exact)
    given = f", with {names} taken as exact (no tolerance is declared)" if exact else ""
    texts = [f"To be trusted{given}: {', '.join(sure)}."] if sure else []
    also = [VERDICTS[word].lower() for word in report["also"]]
    second += f" Also: {', '.join(also)}." if also else ""
    texts += details["doubts"]
    return (f"{chances_sentence(report)}.", second, error_sentence(report),
            " ".join(texts) or "No parameter was identified.")  # fmt: skip


def moved_constants(constants: Mapping[str, float]) -> list[str]:
    """Return constants that would do what an effect does, in words."""
    return [f"{name} {abs(share):.1%} {'above' if share > 0.0 else 'below'} its declared value"
            for name, share in constants.items()]  # fmt: skip


def chances_sentence(report: Mapping[str, Any]) -> str:
    """Return the probabilities in one line, and among how many effects they were asked for."""
    named, known = report["probabilities"]["among"]
    asked = f" (among {named} of {known} effects)" if named < known else ""
    return sentence_of(report["probabilities"]) + asked


def probability_table(report: Mapping[str, Any]) -> Table:
    """Return what may be missing, with its probability and what may stand in its place."""
    chances = report["probabilities"]
    others = {s["effect"]: ", ".join(s["alternatives"]) for s in report["steps"]}
    kinds = {"effects": "effect", "records": "one record", "drifts": "drift from record to record"}
    rows = [(name, p, kind, others.get(name, "")) for key, kind in kinds.items() for name, p in chances[key].items()]
    rows += [("something that the library does not hold", chances["unknown"], "", ""),
             ("nothing", chances["nothing"], "", "")]  # fmt: skip
    columns = ["what", Column("probability", "probability", ".2f"), "kind", "in its place"]
    named, known = chances["among"]
    why = f" {known - named} effects are not named: {UNNAMED}" if named < known else ""
    return table("Probabilities", columns, rows, PROBABILITIES_NOTE + why)


def error_sentence(report: Mapping[str, Any]) -> str:
    before, after = report["error"]["before"], report["error"]["after"]
    which, on = ("holdout", "the records held out") if after["holdout"] else ("train", "the train records")
    was, now = rmse_text(before[which], report["unit"]), rmse_text(after[which], report["unit"])
    of_those = report["noise_rms_holdout"] if which == "holdout" else None
    unit, output = shown(0.0, report["unit"])[1], next(iter(report["outputs"].values()))
    alone = "" if which == "holdout" else "; no record was held out"
    text, errors = f"{was} before, {now} {unit} RMSE after;", [before[which], after[which]]
    if not report["effects"]:
        text, errors = f"{now} {unit} RMSE,", [after[which]]
    unseen = which == "holdout"
    noise = noise_text(of_those or report["noise_rms"], output, after[which], unseen)
    moved = moved_text(report["outputs"], after[which], unseen)
    return f"Error on {on}: {text} {noise}{alone}.{others_text(*errors)}{moved}"


def step_table(report: Mapping[str, Any]) -> Table:
    unit, rows, last = report["unit"], [], report["error"]["before"]
    for step in report["steps"]:
        own = [f"{name.partition('.')[2]} {value_text(p)}" for name, p in step["parameters"].items()
               if name.startswith(f"{step['effect']}.") and p["low"] is not None]  # fmt: skip
        errors = ["none" if step["error"][which] is None else
                  f"{rmse_text(last[which], unit)} -> {rmse_text(step['error'][which], unit)}"
                  for which in ("holdout", "train")]  # fmt: skip
        moved = [f"{name} {share:+.1%}" for name, share in step["instead"].items()]
        alternatives = ", ".join([*step["alternatives"], *moved]) or "none"
        claimed = "" if step["claimed"] else " (candidate)"
        form = f":{step['form']}" if step.get("form") else ""
        rows.append((step["effect"] + form + claimed, *errors, alternatives, "; ".join(own), step["port"]))
        last = step["error"]
    name = shown(0.0, unit)[1]
    note = (f"RMSE before and after, {name}; 95 % intervals. Or: what the records cannot tell from the effect. "
            "`--effects NAME:FORM` declares a form that is not the first.")  # fmt: skip
    return table("Steps", ["effect", "RMSE, holdout", "RMSE, train", "or", "parameters", "port"], rows, note)


def log_table(report: Mapping[str, Any]) -> Table:
    """Return one line a model that was fitted."""
    log = report["log"]
    rows = [(" + ".join(m["hypotheses"]) or "nothing", m["log_probability"], m["chi2_per_sample"]) for m in log]
    columns = ["model", Column("log_probability", "log probability, the best 0", ".2f"),
               Column("chi2_per_sample", "chi2 per sample", ".4g")]  # fmt: skip
    is_named = log and not any(name.startswith("something at") for name in log[0]["hypotheses"])
    unseen = (" Tests, or records held out, find more than the first of them explains: something unknown acts besides."
              if is_named and report["probabilities"]["unknown"] >= MENTIONED else "")  # fmt: skip
    return table("Models", columns, rows, f"Train records; chi2 per sample of noise is 1.{unseen}")


def parameter_table(report: Mapping[str, Any]) -> Table:
    before, after = report["parameters"]["before"], report["parameters"]["after"]
    rows = [(name, value_text(p, struck=True), text_of_noise_alone(p), trust_text(p),
             value_text(before[name], struck=True) if name in before else "") for name, p in after.items()]  # fmt: skip
    note = (
        "95 % intervals count all models that were fitted; those of noise alone take the model in force as true, with "
        "constants as they were fitted (`identify` takes them as declared). Struck through (~ ~): do not rely on it, "
        "as something is missing, or the value rests at its bound."
    )
    return table("Parameters", ["parameter", "after", "of noise alone", "trusted", "before"], rows, note)


def trust_text(p: Mapping[str, Any]) -> str:
    return "yes" if p["trusted"] else "fixed" if p["low"] is None else "no"


def text_of_noise_alone(p: Mapping[str, Any]) -> str:
    if p["noise_low"] is None or p["noise_high"] is None:
        return ""
    factor = scale_of(p["unit"], p["value"])[1]
    return f"{factor * p['noise_low']:.5g} to {factor * p['noise_high']:.5g}"


def residual_section(details: Mapping[str, Any], unit: str) -> Section:
    figures, rows = [], []
    for i, record in enumerate(details["records"]):
        rows += [(record["record"], record["role"], model, record["error"][model]) for model in ("before", "after")]
        own = record["unit"]
        was, now = (rmse_text(record["error"][model], own) for model in ("before", "after"))
        title = f"{record['file']} ({record['role']}), RMSE {was} to {now} {shown(0.0, own)[1]}"
        figures.append(Figure(f"r{i}", title, "", partial(record_figure, record, own)))
    text = (
        "Measured minus simulated; the grey band is two standard deviations of the noise. Slide to one end to "
        "see one model alone. Of long records the least and the largest sample of each short interval are drawn. "
    )
    gallery = Gallery(tuple(figures), "Measured minus simulated", "residuals")
    note = records_note(len(figures), details["n_records"])
    errors = error_table("Errors of each record", ["record", "role", "model"], rows, unit, note)
    return Section("Residual of each record", (gallery, errors), text + note)


def advice_table(advice: list[Mapping[str, Any]], words: list[str]) -> Table:
    rows = [(text, " and ".join(a["separates"]), a["power"]) for text, a in zip(words, advice, strict=True)]
    note = "Power: chance that one such record lets the right effect win, the lowest of all pairs."
    columns = ["manoeuvre", "separates", Column("power", "power [%]", ".0f", 100.0)]
    return table("Manoeuvres to record, best first", columns, rows, note)


def advice_sentence(best: Mapping[str, Any], words: str) -> str:
    names = " and ".join(best["separates"])
    if best["power"] < WEAK:
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


def parts_of(loop: ClosedLoop) -> Parts:
    report, details = report_of(loop), details_of(loop)
    return Parts(report, details, figures_of(loop, report, details))


def details_of(loop: ClosedLoop) -> dict[str, Any]:
    """Return details as JSON can hold them, SI; the command adds `made_by`, its line and options.

    Of long records each curve keeps the samples that `thinned` chooses.
    """
    before, after = loop.before, loop.after
    in_force = loop.inference.exploration.fits[loop.inference.in_force]
    records = [*record_entries(before.train, after.train), *record_entries(before.holdout, after.holdout)]
    diagnoses = {
        name: {role: None if seen is None else diagnosis_sentences(seen)
               for role, seen in (("train", judged.train), ("holdout", judged.holdout))}
        for name, judged in (("before", before), ("after", after))
    }  # fmt: skip
    return plain({
        "versions": versions_of(PACKAGES_OF_IDENTIFY),
        "headline": headline(loop),
        "conclusion": conclusion(loop),
        "shifts": (shift_sentences(before, after) if loop.steps else [])
        + ([] if loop.verdict == "no_discrepancy" else constant_sentences(in_force)),
        "doubts": doubt_sentences(after),
        "suspects": [fault_sentence(s) for s in loop.suspects],
        "declared_by": declared_by(loop),
        "diagnosis": diagnoses if loop.steps else diagnoses | {"after": None},
        "missing": missing_sentences(loop.missing) if loop.missing is not None else [],
        "equations": {"before": str(before.model), "after": str(after.model)},
        "records": records[:MOST_RECORDS],
        "n_records": len(records),
        "n_files": len(loop.campaign.records),
        "models": models_of(loop.inference),
        "advice": [a.words for a in loop.advice],
    })  # fmt: skip


def models_of(inference: Inference) -> list[dict[str, Any]]:
    """Return the most probable models with the parameters of the declared model, were each true."""
    entries: dict[str, dict[str, Any]] = {}
    sets = inference.posterior.sets
    for model, _ in inference.exploration.ranked():
        own = frozenset(h.public for h in model)
        # a model counts with and without something unseen; its name holds the likelier case
        probability = sum(p for names, p in sets.items() if names - UNSEEN == own)
        unseen = " + something unknown" if own and 2 * sets.get(own, 0.0) < probability else ""
        if words(model) not in entries and len(entries) < MOST_DRAWN and (probability >= LISTED or not entries):
            known = {n: i for n, i in inference.of_fit(model).items() if n in inference.exploration.declared.values}
            values = inference.exploration.fits[model].values
            entries[words(model)] = {
                "model": words(model) + unseen, "probability": probability,
                "parameters": {n: {"value": values[n], "low": i.low, "high": i.high} for n, i in known.items()},
            }  # fmt: skip
    return sorted(entries.values(), key=lambda entry: -entry["probability"])


def headline(loop: ClosedLoop) -> str:
    """Return the verdict in a few words."""
    stands = loop.withdrawn is not None and not loop.after.fails_to_carry_over
    return "Withdrawn" if loop.verdict == "does_not_carry_over" and stands else VERDICTS[loop.verdict]


def conclusion(loop: ClosedLoop) -> str:
    """Return the verdict as one sentence."""
    sentence: dict[Verdict, Callable[[ClosedLoop], str]] = {
        "implausible_records": implausible, "record_disagrees": disagreeing_sentence,
        "does_not_carry_over": carried_sentence, "cannot_tell_apart": doubtful, "no_discrepancy": nothing_missing,
        "explained": explained, "partly_explained": partly, "unexplained": unexplained,
    }  # fmt: skip
    return sentence[loop.verdict](loop)


def implausible(loop: ClosedLoop) -> str:
    return f"Nothing is named, as the records look wrong. {loop.next_steps[0]}"


def explained(loop: ClosedLoop) -> str:
    names, judged = " + ".join(loop.effects), "train and holdout"
    if not loop.campaign.holdout:
        judged = "train; no record was held out to judge it"
    return f"The declared model lacked {names}; with it, what remains {as_noise(loop)} on {judged}."


def unexplained(loop: ClosedLoop) -> str:
    output, left = next(iter(loop.outputs.values())), loop.after.train.errors.rmse
    if may_be_inputs(output["noise_rms"], output["moved_by_inputs"], left):
        return "What remains is more than the noise of the sensors, and noise of the inputs may be all of it."
    return lacking(loop)


def lacking(loop: ClosedLoop) -> str:
    return f"The declared model lacks something that the library does not hold. {most_in(loop)}".rstrip()


def most_in(loop: ClosedLoop) -> str:
    """Say in which of several train records most of what remains lies, "" where it is in none."""
    more: dict[str, float] = {}
    for finding in loop.after.diagnosis.of_kind("record"):
        file = finding.where.partition(", ")[0]  # what follows is the output
        more[file] = more.get(file, 0.0) + max(finding.ratio - 1.0, 0.0)
    total = sum(more.values())
    name = max(more, key=lambda n: more[n], default="")
    if len(more) < 3 or not np.isfinite(total) or more[name] <= EXPLAINS * total:
        return ""
    return f"{more[name] / total:.0%} of what the model leaves beyond noise lies in {name}: look at this record first."


def partly(loop: ClosedLoop) -> str:
    best = f"Of the models of names alone, that with {' + '.join(loop.effects)} predicts parts left out of the fit best"
    return f"{lacking(loop)} {best}{unclaimed(loop)}"


def nothing_missing(loop: ClosedLoop) -> str:
    if loop.after.diagnosis.significant or not loop.after.significant:
        text = f"What the declared model leaves {as_noise(loop)}: nothing is missing that these records could show."
    else:
        text = ("What the declared model leaves on the train records is noise: nothing is missing that they could "
                "show. A test finds more than noise on those held out, but their error is less than "
                f"{OVER_NOISE:g} times the noise, as that of a prediction may be.")  # fmt: skip
    return " ".join([text, *constant_sentences(loop.inference.exploration.fits[loop.inference.in_force])])


def as_noise(loop: ClosedLoop) -> str:
    seen = loop.after.diagnosis
    more = f"is a little more than noise (chance {seen.p:.2g}), too little to name a cause"
    return more if seen.significant else "is noise"


def declared_by(loop: ClosedLoop) -> str:
    """Say by which options `identify` takes the effects that were added, in the shapes that were found; "" for none.

    A strength is searched up to some times what was found: far from the answer a motion has many minima.
    """
    fit, library = loop.after.fit, loop.inference.exploration.library
    if not loop.steps or any(key.name.startswith(ERROR_OF) for key in fit.active):
        return ""
    options = [",".join(f"{s.effect}:{s.form}" if s.form else s.effect for s in loop.steps)]
    for name, value in fit.values.items():
        owner, null = library.owner(name), fit.model.parameters[name].null
        if owner is None:
            continue
        if name in library.fixed_shapes(owner):
            options.append(f"--fix {library.public(name)}={value:.6g}")
        elif null not in (None, value):  # at its null a strength has no range
            low, high = sorted((null, null + SEARCHED_TO * (value - null)))
            options.append(f"--bounds {library.public(name)}={low:.3g}:{high:.3g}")
    return f"`armid identify` declares this model with `--effects {' '.join(options)}`."


def unclaimed(loop: ClosedLoop) -> str:
    names = [s.effect for s in loop.steps if not s.claimed]
    if not names:
        return "."
    verb = "is" if len(names) == 1 else "are"
    which = "no name is" if len(names) == len(loop.steps) else f"{' and '.join(names)} {verb} not"
    return f": {which} claimed."


def remains(loop: ClosedLoop) -> str:
    return f"what remains is {'more than ' if loop.after.significant else ''}noise"


def disagreeing_sentence(loop: ClosedLoop) -> str:
    texts = [fault_sentence(s) for s in loop.suspects if s.role == "train"]
    added = f"with {' + '.join(loop.effects)} " if loop.effects else ""
    return f"{' '.join(texts)} Apart from that {added}{remains(loop)}."


def carried_sentence(loop: ClosedLoop) -> str:
    """Say which record held out denies what the train records showed, and by how much."""
    judged = loop.after if loop.withdrawn is None else loop.withdrawn.judged
    unseen = judged.holdout
    assert unseen is not None
    factors = [rms(raw) / level.total for raw, level in zip(unseen.raw, unseen.data.levels, strict=True)]
    worst = int(np.argmax(np.nan_to_num(factors, nan=np.inf)))
    factor, file = factors[worst], unseen.data.each[worst].file
    missed = f"the error on {file} is {float(f'{factor:.3g}'):,g} times the noise"
    if not np.isfinite(factor):
        missed = f"{file} makes the simulation diverge"
    alone = ""
    if sum(over_noise(judged.train, unseen)) == 1:
        alone = " No other held-out record is missed: this one may itself be faulty, for example late or scaled."
    if loop.withdrawn is None and judged.diagnosis.significant:
        named = f"With {' + '.join(loop.effects)} the declared model" if loop.effects else "The declared model"
        return f"{named} leaves more than noise on the train records. {missed_sentences(judged.missed)[0]}{alone}"
    if loop.withdrawn is None:
        return (f"Only noise remains on the train records. Of those held out, {missed}: something acts there "
                f"that the train records do not show.{alone}")  # fmt: skip
    last = loop.after.holdout
    assert last is not None
    names = " + ".join(s.effect for s in loop.withdrawn.steps)
    stands = f"the model with {' + '.join(loop.effects)}" if loop.effects else "the declared model"
    is_noise = not (loop.after.diagnosis.significant or any(over_noise(loop.after.train, last)))
    left = " What it leaves of the records held out is noise." if is_noise else ""
    return (f"Of all names {names} suits the train records best, but the records held out are simulated "
            f"{loop.withdrawn.worse:.0%} worse with it ({missed}): it is withdrawn, and {stands} "
            f"stands.{left}")  # fmt: skip


def doubtful(loop: ClosedLoop) -> str:
    """Say between what these records cannot decide."""
    if not loop.steps:
        return "No single answer is probable: these records tell too little."
    others = {s.effect: [*s.alternatives, *moved_constants(s.instead)] for s in loop.steps}
    texts = [f"{name} cannot be told from {' or '.join(other)}" for name, other in others.items() if other]
    texts += [f"{s.effect} has a probability of {s.probability:.2f}" for s in loop.steps
             if not (s.claimed or others[s.effect])]  # fmt: skip
    rest = "a significant discrepancy remains, and" if loop.after.significant else "what remains is noise, but"
    judged = "" if loop.campaign.holdout else " No record was held out to judge it."
    asked = list(dict.fromkeys(name for s in loop.steps for name in s.instead))
    judged += f" Give the tolerance of {' and '.join(asked)}, 0 where it is exact." if asked else ""
    return f"With {' + '.join(loop.effects)} {rest} on these records {'; '.join(texts)}.{judged}"


def missing_sentences(missing: Missing) -> list[str]:
    ports = ", ".join(f"{s.port} {max(s.share, 0.0):.0%}" for s in missing.signals[:MOST_PORTS])
    texts = [f"A signal without a form would remove this share of the residual at port: {ports}."]
    best = {d.variable: d for d in sorted(missing.dependences, key=lambda d: d.share)}
    ranked = sorted((d for d in best.values() if d.share >= LEAST_SHARE), key=lambda d: -d.share)[:MOST_PORTS]
    curves = ", ".join(f"{d.variable}{TIMES_IN_WORDS[d.factor]} at {d.port} {d.share:.0%}" for d in ranked)
    if not curves:
        return [*texts, "What the residual follows was not found: no curve predicts parts left out of its fit."]
    shares = "What the residual follows, with the share that a curve over it predicts on parts left out"
    return [*texts, f"{shares}: {curves}."]


def diagnosis_sentences(seen: Residuals) -> list[str]:
    diagnosis = seen.diagnosis
    if not diagnosis.significant:
        return [f"What remains cannot be told from noise (least chance of {len(diagnosis.findings)} tests together "
                f"{diagnosis.p:.2g}, {SIGNIFICANCE:g} would be significant)."]  # fmt: skip

    def significant(kind: str) -> list[Finding]:
        """Return the significant findings of one kind, the largest first."""
        findings = [f for f in diagnosis.of_kind(kind) if f.p * len(diagnosis.findings) < SIGNIFICANCE]
        return sorted(findings, key=lambda f: -f.ratio)[:MOST_FINDINGS]

    texts = [f"What remains is more than noise (chance {'below ' if diagnosis.p < LEAST_CHANCE else ''}"
            f"{max(diagnosis.p, LEAST_CHANCE):.2g})."]  # fmt: skip
    if not diagnosis.noise_known:
        levels = seen.data.levels
        of = f" of {sum(not level.known for level in levels)} of {len(levels)} signals" if levels[1:] else ""
        texts.append(f"No rest tells the noise{of}: the residual is tested against itself.")
    wholes = {
        "size": "Its mean square is {ratio:.4g} times that of the noise.",
        "repeats": "Repeats of {where} agree with each other {ratio:.3g} times better than with the model (mean "
                   "squares, pure-error lack of fit).",
        "autocorrelation": "It is correlated in time: the Ljung-Box statistic over {where} is {ratio:.3g} times what "
                           "noise gives.",
    }  # fmt: skip
    texts += [text.format(**vars(f)) for kind, text in wholes.items() for f in significant(kind)[:1]]
    texts += filter(None, (time_in_words(seen),))
    kinds = (("record", "record"), ("stage", "stage"), ("dependence", "variable"), ("frequency", "frequency"))
    for kind, name in kinds:
        places = ", ".join(f"{f.where} ({f.ratio:.3g} times the noise)" for f in significant(kind))
        texts += [f"Where it is, by {name}: {places}."] if places else []
    return texts


def shift_sentences(before: Judgement, after: Judgement) -> list[str]:
    later, texts = {e.name: e for e in after.estimates}, []
    for old in before.estimates:
        new = later[old.name]
        # Only trusted parameters show a bias: others may be as wrong as before.
        if new.trusted and old.low is not None and abs(old.value - new.value) > SHIFTED * abs(new.value):
            share = (old.value - new.value) / abs(new.value) if new.value else np.inf
            texts.append(f"{old.name} was biased by {share:+.2%}: {value_text(old.entry)} before, "
                        f"{value_text(new.entry)} after.")  # fmt: skip
    return texts


def constant_sentences(fit: Fit) -> list[str]:
    """Say which constants are farther from their declared values than 95 % of sound ones."""
    texts = []
    for name, off in fit.deviations.items():
        if abs(off) > NORMAL_95:
            share = f" ({fit.constants[name]:+.1%})" if name in fit.constants else ""
            side = "above" if off > 0.0 else "below"
            texts.append(f"{name} is {abs(off):.1f} standard deviations {side} its declared value{share}.")
    return texts


def doubt_sentences(judged: Judgement) -> list[str]:
    """Say which parameters are not to be trusted, and each reason once."""
    doubted = [e for e in judged.estimates if e.doubts and e.low is not None]
    if not doubted:
        return []
    reasons: dict[str, list[str]] = {}
    for e in doubted:
        for why in e.doubts:
            reasons.setdefault(why, []).append(e.name)
    each = [why if len(names) == len(doubted) else f"{why} ({', '.join(names)})" for why, names in reasons.items()]
    return [f"Not to be trusted: {', '.join(e.name for e in doubted)}. Why: {'; '.join(each)}."]
