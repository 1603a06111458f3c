"""The page of a closed loop, from report.json, details.json and the figures beside them."""

from collections.abc import Mapping
from typing import Any

from armid.display import SHOWN, shown
from armid.page.cells import grid, number_cell
from armid.page.curves import candidate_drawing, residual_drawing
from armid.page.equations import changed, lines
from armid.page.loop_tables import advice_grid, errors_section, parameters_grid, steps_grid
from armid.page.page import Cell, Gallery, Listing, Page, Part, Section, Sentences
from armid.page.parts import drawing, drawings, made_section, records_note, value_text

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
