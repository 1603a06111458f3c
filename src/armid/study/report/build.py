"""Build the report of a study from its stored results."""

from pathlib import Path
from typing import Any

from armid.model import ArmidError
from armid.study.kind import IDENTIFIES, KINDS, Kind, function
from armid.study.metrics import Results
from armid.study.report.answer import answer
from armid.study.report.evidence import Evidence
from armid.study.report.general import (
    best_fitness_section,
    convergence_section,
    errors_section,
    ranks_section,
    running_time_section,
    runs_section,
    success_section,
)
from armid.study.report.report import Report, Section
from armid.study.report.special import cramer_rao_section, fitness_section, table1_section, table2_section
from armid.study.tables import Table, overview, values

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
    report: Report = function(kind_of(results).reported_by)(results, key)
    return report


def summary_of(results: Results) -> Report:
    """Return the report with the one table that is printed when a study ends; no truth that was kept from it enters."""
    report: Report = function(kind_of(results).summed_up_by)(results)
    return report


def kind_of(results: Results) -> Kind:
    """Return the kind of a study.

    Raises ArmidError for one that this version does not know.
    """
    kind = results.study.get("kind", IDENTIFIES)
    if kind not in KINDS:
        raise ArmidError(f"study '{results.study['name']}' is of kind '{kind}', one of {', '.join(KINDS)} is expected")
    return KINDS[kind]


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
    sections = (Section("Overview", "", (main,)), *(s for s in made if s is not None), runs_section(evidence))
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
