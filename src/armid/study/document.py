"""Build the report of a study from its stored results."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pandas import DataFrame

from armid.errors import ArmidError
from armid.report.document import (
    Cell,
    Drawing,
    Grid,
    Line,
    Listing,
    Page,
    Part,
    Section,
    Sentences,
    drawing,
    listing,
    number_cell,
    text_cell,
)
from armid.study.analyses.errors import values
from armid.study.analyses.outcomes import Results
from armid.study.analyses.overview import PAPER, overview
from armid.study.analyses.table import Table, shown_rows
from armid.study.report import Evidence, Report, ReportSection
from armid.study.sections import (
    best_fitness_section,
    convergence_section,
    cramer_rao_section,
    errors_section,
    fitness_section,
    ranks_section,
    running_time_section,
    runs_section,
    success_section,
    table1_section,
    table2_section,
)
from armid.study.spec import CLOSES_LOOP, IDENTIFIES, KIND_NAMES

MOST_SETTINGS = 2


def answer(evidence: Evidence) -> tuple[str, ...]:
    """Return who came nearest to the truth (without truths: to the best fitness), and how the others stand to that."""
    if evidence.knows_truth:
        return nearest_to_truth(evidence), beside_the_paper(evidence)
    return (lowest_fitness(evidence),)


def nearest_to_truth(evidence: Evidence) -> str:
    """Return the identifier with the smallest median largest error, of each setting."""
    said = []
    for setting in evidence.settings[:MOST_SETTINGS]:
        errors = by_variant(evidence.of(setting))
        best = min(errors, key=lambda v: float(median(errors[v])))
        p95 = np.quantile(errors[best], 0.95, method="inverted_cdf")
        said.append(f"{setting}: {best}, median largest error of a run {percent(median(errors[best]))}, "
                    f"95 % of its {len(errors[best])} runs within {percent(float(p95))}")  # fmt: skip
    more = len(evidence.settings) - MOST_SETTINGS
    return f"Nearest to the truth: {'; '.join(said)}{f'; {more} more settings below' if more > 0 else ''}."


def beside_the_paper(evidence: Evidence) -> str:
    """Return how many identifiers are better than the paper's published result, or the range of all medians."""
    errors = by_variant(evidence.of(evidence.settings[0]))
    medians = {variant: median(values) for variant, values in errors.items()}
    if not evidence.published.empty and evidence.study.get("report") == "table1":
        own = float(np.median(evidence.published.groupby("case")["relative_error"].max()))
        better = [v for v, value in medians.items() if value < own]
        return (f"{PAPER[0].upper()}{PAPER[1:]}, from its printed values on its own data, has {percent(own)}; "
                f"{len(better)} of {len(medians)} identifiers are below that.")  # fmt: skip
    worst = max(medians, key=lambda v: medians[v])
    return f"Of {len(medians)} identifiers the furthest is {worst} with {percent(medians[worst])}."


def lowest_fitness(evidence: Evidence) -> str:
    """Return who came to the lowest median fitness, of each fitness."""
    done = evidence.found[evidence.found["status"] == "done"]
    if done.empty:
        return "No run has a result."
    medians = done.groupby(["fitness", "variant"], sort=False)["value"].median()
    said = []
    for fitness in dict.fromkeys(done["fitness"]):
        own = medians.loc[fitness]
        said.append(f"{own.idxmin()}, {own.min():.6g} of {fitness}")
    return f"No truth is known. Lowest median fitness: {'; '.join(said)}."


def by_variant(found: DataFrame) -> dict[str, np.ndarray]:
    """Return variant -> largest relative error of each run; infinite for a failed one."""
    return {str(v): g["largest_error"].to_numpy(float) for v, g in found.groupby("variant", sort=False)}


def median(values: np.ndarray) -> float:
    """Return the median as the tables have it: a value that occurs."""
    return float(np.quantile(values, 0.5, method="inverted_cdf"))


def percent(value: float) -> str:
    """Return a share in per cent."""
    return "not finite" if not np.isfinite(value) else f"{100.0 * value:.3g} %"


BUILDERS = (
    table1_section, table2_section, cramer_rao_section, fitness_section, success_section, running_time_section,
    best_fitness_section, convergence_section, errors_section, ranks_section,
)  # fmt: skip
ALONE = "A seed decides the search alone; the noise is the records' own."
PAIRED = "The same seed gives the same noise to all identifiers, so that they are compared in pairs."
SYNTHETIC = (
    "Synthetic: records are simulated from a known truth by the model that is identified, and white noise of the "
    "stated level (standard deviation) is added; no measured data enters."
)


def report_of(results: Results, key: Path | None = None) -> Report:
    """Return tables and figures of a study as far as it was run; nothing is drawn yet.

    key: file of a truth that was kept from the study, None: the one that it names.

    Raises ArmidError when no run has ended, where a key is needed and not there, and for a kind that nobody knows.
    """
    if kind_of(results) == CLOSES_LOOP:
        from armid.study.blind.report import loops_report

        return loops_report(results, key)  # type: ignore[arg-type]
    return identify_report(results, key)


def summary_of(results: Results) -> Report:
    """Return the report with the one table that is printed when a study ends; no truth that was kept from it enters."""
    if kind_of(results) == CLOSES_LOOP:
        from armid.study.blind.report import loops_summary

        return loops_summary(results)  # type: ignore[arg-type]
    return identify_summary(results)


def kind_of(results: Results) -> str:
    """Return the kind of a study.

    Raises ArmidError for one that this version does not know.
    """
    kind = str(results.study.get("kind", IDENTIFIES))
    if kind not in KIND_NAMES:
        name = results.study["name"]
        raise ArmidError(f"study '{name}' is of kind '{kind}', one of {', '.join(KIND_NAMES)} is expected")
    return kind


def identify_summary(results: Results) -> Report:
    """Return state and main table of a study that identifies."""
    evidence = Evidence(results)
    return Report(str(results.study["name"]), "", state(evidence.study, evidence), (), main_table(evidence), ())


def identify_report(results: Results, key: Path | None = None) -> Report:
    """Return the report of a study that identifies.

    Raises ArmidError when no run has ended, and for a key, since nothing was kept from such a study.
    """
    if key is not None:
        raise ArmidError(f"study '{results.study['name']}' knows its truths, a key is not expected")
    if results.runs.empty:
        raise ArmidError(f"study '{results.study['name']}' has no finished run: nothing can be reported")
    evidence = Evidence(results)
    main = main_table(evidence)
    made = [build(evidence) for build in BUILDERS] if not evidence.parameters.empty else []
    sections = (ReportSection("Overview", "", (main,)), *(s for s in made if s is not None), runs_section(evidence))
    study = evidence.study
    return Report(str(study["name"]), str(study.get("question", "")), state(study, evidence), facts(evidence), main,
                  sections, answer(evidence))  # fmt: skip


def main_table(evidence: Evidence) -> Table:
    """Return the table that is printed: errors where truths are known, else values."""
    if evidence.knows_truth:
        is_table1 = evidence.study.get("report") == "table1"
        return overview(evidence.found, evidence.estimates, evidence.published if is_table1 else evidence.published[:0])
    return values(evidence.found, evidence.estimates)


def state(study: dict[str, Any], evidence: Evidence) -> str:
    """Return how much of the study was run."""
    planned, there = int(study["n_planned"]), len(evidence.found)
    failed = int((evidence.found["status"] != "done").sum())
    lost = f", {failed} of them failed" if failed else ""
    if there < planned:
        return f"NOT COMPLETE: {there} of {planned} runs have ended{lost}; every number below is of these."
    return f"Complete: {there} of {planned} runs{lost}."


def facts(evidence: Evidence) -> tuple[str, ...]:
    """Return how it was made, one sentence each."""
    study, found = evidence.study, evidence.found
    budgets = sorted(set(found["budget"]))
    effects = f" with {', '.join(study['effects'])}" if study.get("effects") else ""
    return (
        origin(study),
        f"Plant: {study['plant']}{effects}. Fitness: {', '.join(dict.fromkeys(found['fitness']))}.",
        f"{len(evidence.cases)} cases, {len(evidence.variants)} identifiers, {found['seed'].nunique()} seeds, "
        f"noise and windows: {'; '.join(evidence.settings)}.",
        f"Budget: {' and '.join(f'{b:g}' for b in budgets)} simulations a run; {found['used'].sum():,.0f} in all.",
        PAIRED if found["noise_deg_s"].notna().any() else ALONE,
        f"Versions: {versions(study)}.",
    )


def origin(study: dict[str, Any]) -> str:
    """Return where the records come from."""
    simulated = [c for c in study["cases"] if not c.get("campaign")]
    campaigns = sorted({str(c["campaign"]) for c in study["cases"] if c.get("campaign")})
    parts = []
    if simulated:
        parts.append(SYNTHETIC)
    if campaigns:
        known = any(c.get("truth") for c in study["cases"] if c.get("campaign"))
        parts.append(f"Records of {', '.join(campaigns)}{' (their truth is known: synthetic)' if known else ''}.")
    return " ".join(parts)


def versions(study: dict[str, Any]) -> str:
    """Return the packages that made the runs."""
    return ", ".join(f"{name} {version}" for name, version in sorted(dict(study.get("versions") or {}).items()))


def study_page(
    report: Report, svgs: Mapping[str, str], text: str, models: Sequence[str], commands: Sequence[str]
) -> Page:
    """Return the page.

    svgs: name of a figure -> SVG; text: the study's TOML file; models: equations of its models; commands: make the
    results and the page again.
    """
    complete = report.state.startswith("Complete")
    answer = (*report.answer, report.state) if complete else report.answer or (report.state,)
    sections = [page_section(s, svgs) for s in report.sections]
    sections.append(made_section(report, text, models, commands))
    return Page(report.name, "Study", report.question, answer, tuple(sections),
                warning="" if complete else report.state)  # fmt: skip


def page_section(section: ReportSection, svgs: Mapping[str, str]) -> Section:
    """Return a section with its tables and figures."""
    parts: list[Part] = [study_grid(t) for t in section.tables if t.most]
    parts += [study_drawing(f.name, f.title, f.words, svgs) for f in section.figures if f.name in svgs]
    return Section(section.title, tuple(parts), section.words)


def study_drawing(name: str, title: str, words: str, svgs: Mapping[str, str]) -> Drawing:
    """Return a figure."""
    return drawing(title, svgs[name], f"{name}-", words)


def study_grid(table: Table) -> Grid:
    """Return a table as the report shows it; it sorts by its numbers, not by their digits."""
    more = f" {table.n_hidden} more lines are in {table.name}.csv." if table.n_hidden else ""
    right = tuple(bool(c.digits) for c in table.columns)
    return Grid(table.title, tuple(c.header for c in table.columns), table_rows(table), right, f"{table.words}{more}")


def table_rows(table: Table) -> tuple[tuple[Cell, ...], ...]:
    """Return the cells."""
    frame = table.frame.head(table.most)
    columns = [list(frame[c.key]) for c in table.columns]
    rows = []
    for i, texts in enumerate(shown_rows(table)):
        cells = [number_cell(float(values[i]), c.digits, c.factor) if c.digits else text_cell(text)
                 for text, values, c in zip(texts, columns, table.columns, strict=True)]  # fmt: skip
        rows.append(tuple(cells))
    return tuple(rows)


def made_section(report: Report, text: str, models: Sequence[str], commands: Sequence[str]) -> Section:
    """Return facts, commands, the study's file and the equations."""
    parts: list[Part] = [
        Sentences(report.facts), Listing("Commands; the study's file is below", tuple(map(Line, commands))),
        listing(f"{report.name}.toml", text, folded=True),
    ]  # fmt: skip
    for i, model in enumerate(models):
        title = "Equations of the model" if len(models) == 1 else f"Equations of model {i + 1} of {len(models)}"
        parts.append(listing(title, model, folded=True))
    return Section("How it was made", tuple(parts))
