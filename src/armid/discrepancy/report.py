"""The report of the closed loop as text."""

from collections.abc import Sequence

from armid.discrepancy.conclusion import conclusion
from armid.discrepancy.result import ClosedLoop
from armid.discrepancy.words import (
    advice_sentence,
    diagnosis_sentences,
    doubt_sentences,
    missing_sentences,
    parameter_rows,
    shift_sentences,
    step_headers,
    step_rows,
)
from armid.display import SHOWN, shown


def markdown(found: ClosedLoop, figures: Sequence[str]) -> str:
    """Return report.md; figures: names of the files beside it."""
    value, unit = shown(found.noise_rms, found.campaign.unit)
    lines = [
        f"# {found.campaign.name}: what the declared model lacks", "", f"**{found.verdict}.** {conclusion(found)}", "",
        f"Plant {found.campaign.plant.name}, {len(found.campaign.train)} records to train, "
        f"{len(found.campaign.holdout)} held out; noise {value:.3g} {unit} rms.",
    ]  # fmt: skip
    lines += section("Steps", table(step_headers(found), step_rows(found)) if found.steps else ["No effect was added."])
    lines += section("Errors", table(error_headers(found), error_rows(found)))
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


def error_headers(found: ClosedLoop) -> list[str]:
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
    scores = found.search.trace(found.before.fit)[:most]
    return [[found.library.public(s.name), f"{s.drop:.4g}", f"{s.p:.2g}"] for s in scores]
