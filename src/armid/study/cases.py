"""Cases out of the study's file: simulated ones, random ones, and campaigns."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from armid.model import ArmidError, Model, Plant
from armid.problem import Space
from armid.record.constants import record_constants
from armid.record.pieces import SLACK
from armid.record.schema import RecordSheet, unknown_name, validated
from armid.record.shown import shown
from armid.record.timing import FEWEST_SAMPLES
from armid.study.box import box_of
from armid.study.campaign_case import campaign_case
from armid.study.case import Case, Stroke
from armid.study.known import Known
from armid.study.latin import spread
from armid.study.sheet import WHOLE, CaseSheet, ManoeuvreSheet, RandomSheet, StudySheet

MOST_SAMPLES = 10**7


def cases_of(sheet: StudySheet, model: Model, known: Known, folder: Path, where: str) -> tuple[Case, ...]:
    """Return the cases of a study, random ones last.

    model: the plant with the study's effects. folder: of the study's file.

    Raises ArmidError for a case that asks for what cannot be.
    """
    cases = [case_of(table, i, sheet, model, known, folder, where) for i, table in enumerate(sheet.cases)]
    if sheet.random_cases is not None:
        cases += random_cases(sheet, model, where)
    if not cases:
        raise ArmidError(f"{where}: there is no case, a table [[cases]] or [random_cases] is expected")
    names = [case.name for case in cases]
    for name in names:
        if names.count(name) > 1:
            raise ArmidError(f"{where}: case '{name}' is there twice, each name once is expected")
        if "/" in name:
            raise ArmidError(f"{where}: the name of case '{name}' holds '/', which --only needs between case and "
                             "identifier, another sign is expected")  # fmt: skip
    return tuple(cases)


def case_of(
    table: Mapping[str, Any], index: int, sheet: StudySheet, model: Model, known: Known, folder: Path, where: str
) -> Case:
    """Return one [[cases]] entry."""
    name = table.get("name")
    at = f"{where}, case {shown(name) if isinstance(name, str) else index + 1}"
    entry = validated(CaseSheet, table, at)
    if (entry.campaign is None) == (not entry.manoeuvres):
        both = "both are" if entry.campaign is not None else "neither is"
        raise ArmidError(f"{at}: manoeuvres to simulate or a campaign to read is expected, {both} given")
    if entry.campaign is not None:
        case = campaign_case(entry, sheet, known, folder, at)
        check_truth(case, at)
        return case
    if entry.records is not None:
        raise ArmidError(f"{at}: 'records' are files of a campaign, and no campaign is given")
    space = box_of(model, {}, sheet, entry, at)
    return simulated_case(entry.name, entry.truth, entry.published, entry.manoeuvres, space, sheet, model, at)


def simulated_case(
    name: str,
    truth: Mapping[str, float],
    published: Mapping[str, float],
    manoeuvres: Sequence[Mapping[str, Any]],
    space: Space,
    sheet: StudySheet,
    model: Model,
    where: str,
) -> Case:
    """Return a case whose records the engine makes at the truth."""
    if model.plant.inputs:
        raise ArmidError(f"{where}: plant '{model.plant.name}' is driven by {model.plant.inputs[0].name}, which no "
                         "manoeuvre tells: a campaign is expected")  # fmt: skip
    strokes = tuple(
        stroke_of(m, sheet, model.plant, f"{where}, manoeuvre {i + 1}") for i, m in enumerate(manoeuvres)
    )
    if not any(s.role == "train" for s in strokes):
        raise ArmidError(f"{where}: no manoeuvre has the role 'train', at least one is expected")
    case = Case(name, model, space, completed(truth, model, where), dict(published), strokes)
    check_truth(case, where)
    check_windows(case, sheet, where)
    return case


def stroke_of(table: Mapping[str, Any], sheet: StudySheet, plant: Plant, where: str) -> Stroke:
    """Return one manoeuvre, its constants laid over those of the study."""
    manoeuvre = validated(ManoeuvreSheet, table, where, [key.key for key in plant.keys])
    record = RecordSheet(file="", role=manoeuvre.role, constants=manoeuvre.constants, keys=manoeuvre.keys)
    constants = record_constants(plant, sheet.constants, record, where)
    n_samples = manoeuvre.duration_s / sheet.interval_s
    if not FEWEST_SAMPLES - 1 <= n_samples <= MOST_SAMPLES:
        raise ArmidError(f"{where}: duration_s is {manoeuvre.duration_s:g}, {FEWEST_SAMPLES} to {MOST_SAMPLES} samples "
                         f"of {sheet.interval_s:g} s are expected")  # fmt: skip
    return Stroke(constants, manoeuvre.duration_s, manoeuvre.role)


def completed(truth: Mapping[str, float], model: Model, where: str) -> dict[str, float]:
    """Return the true value of every parameter: an effect's that is not given is its null value.

    Raises ArmidError for an unknown parameter and for one of the plant that is missing.
    """
    for name in truth:
        if name not in model.parameters:
            raise unknown_name("parameter of the truth", name, model.parameters, where)
    known = {name: p.null for name, p in model.parameters.items()} | dict(truth)
    for name, value in known.items():
        if value is None:
            raise ArmidError(f"{where}: the truth does not tell '{name}', a value in SI is expected")
    return {name: float(value) for name, value in known.items() if value is not None}


def check_truth(case: Case, where: str) -> None:
    """Refuse a truth that the search cannot find, and published values of what is not in the model."""
    for name in (*case.truth, *case.published):
        if name not in case.space.names:
            raise unknown_name("parameter", name, case.space.names, where)
    for name, (low, high) in case.bounds.items():
        value = case.truth.get(name)
        if value is not None and not low <= value <= high:
            raise ArmidError(f"{where}: the truth of '{name}' is {value:.10g}, outside its bounds {low:g} to {high:g}")
    if not case.bounds:
        raise ArmidError(f"{where}: every parameter is fixed, at least one that is searched is expected")


def check_windows(case: Case, sheet: StudySheet, where: str) -> None:
    """Refuse a window that holds too little of a manoeuvre."""
    for window in sheet.windows_s:
        if window == WHOLE:
            continue
        begin, end = (float(t) for t in window)
        for stroke in case.strokes:
            last = round(stroke.duration_s / sheet.interval_s)
            first = max(int(np.ceil(begin / sheet.interval_s - SLACK)), 0)
            held = min(int(np.floor(end / sheet.interval_s + SLACK)), last) - first + 1
            if not begin < end or held < FEWEST_SAMPLES:
                raise ArmidError(f"{where}: window [{begin:g}, {end:g}] holds {max(held, 0)} samples of a manoeuvre of "
                                 f"{stroke.duration_s:g} s, at least {FEWEST_SAMPLES} are expected")  # fmt: skip


def random_cases(sheet: StudySheet, model: Model, where: str) -> list[Case]:
    """Return cases whose truths are spread over the box by a Latin hypercube."""
    at = f"{where}, random_cases"
    wanted = validated(RandomSheet, sheet.random_cases, at)
    if wanted.margin >= 0.5:
        raise ArmidError(f"{at}: margin is {wanted.margin:g}, a share of the range from 0 to below 0.5 is expected")
    space = box_of(model, {}, sheet, None, at)
    truths = spread(space, wanted.n, wanted.seed, wanted.margin)
    digits = len(str(wanted.n))
    first = simulated_case("", truths[0], {}, wanted.manoeuvres, space, sheet, model, at)
    known = [completed(truth, model, at) for truth in truths]
    return [replace(first, name=f"random {i:0{digits}d}", truth=truth) for i, truth in enumerate(known, 1)]
