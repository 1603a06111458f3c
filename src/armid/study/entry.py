"""Who searches in a study: identifier, options, budget, fitness."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from armid.model import ArmidError
from armid.record.schema import validated
from armid.record.shown import shown
from armid.study.case import Case
from armid.study.known import Known, chosen
from armid.study.sheet import EntrySheet, StudySheet


@dataclass(frozen=True, eq=False)
class Entry:
    """Hold one identifier of a study with all that was left to the study filled in.

    label: how reports call it. noise_deg_s: levels it is tried at. seeds: of its search and of the noise.
    """

    label: str
    name: str
    options: Mapping[str, Any]
    budget: int
    fitness: tuple[str, ...]
    noise_deg_s: tuple[float, ...]
    seeds: tuple[int, ...]


def entries_of(sheet: StudySheet, known: Known, where: str) -> tuple[Entry, ...]:
    """Return the identifiers of a study, each built once with its budget to see that it can be.

    Raises ArmidError for an unknown name, an option that is refused, and two entries that could not be told apart.
    """
    entries = []
    for i, table in enumerate(sheet.identifiers):
        name = table.get("label", table.get("name"))
        at = f"{where}, identifier {shown(name) if isinstance(name, str) else i + 1}"
        entry = entry_of(validated(EntrySheet, table, at), sheet)
        check_built(entry, known, at)
        entries.append(entry)
    check_apart(entries, where)
    return tuple(entries)


def entry_of(own: EntrySheet, sheet: StudySheet) -> Entry:
    """Return an entry with the study's values where it has none."""
    return Entry(
        label=own.label or own.name,
        name=own.name,
        options=dict(own.options),
        budget=own.budget or sheet.budget,
        fitness=own.fitness or sheet.fitness,
        noise_deg_s=sheet.noise_deg_s if own.noise_deg_s is None else own.noise_deg_s,
        seeds=own.seeds or sheet.seeds,
    )


def check_built(entry: Entry, known: Known, where: str) -> None:
    """Refuse an identifier that cannot be built with its options and budget, or cannot minimise its fitness."""
    identifier = known.identifier(entry.name, where)
    try:
        for fitness in entry.fitness:
            identifier.refuse(chosen(known.fitness, fitness, "fitness", where))
        identifier.with_options(entry.options).build(entry.budget)
    except ArmidError as error:
        raise ArmidError(f"{where}: {error}") from error
    except Exception as error:
        raise ArmidError(f"{where}: it cannot be built: {type(error).__name__}: {error}") from error


def check_apart(entries: Sequence[Entry], where: str) -> None:
    """Refuse a label that stands for two things, and a setting that two entries ask for."""
    for i, entry in enumerate(entries):
        for other in entries[:i]:
            same_label = other.label == entry.label
            same_thing = (other.name, other.options) == (entry.name, entry.options)
            if same_label and not same_thing:
                raise ArmidError(f"{where}: label '{entry.label}' stands for identifiers of other name or options, "
                                 "a label of its own is expected for each")  # fmt: skip
            if (same_label or (same_thing and other.budget == entry.budget)) and meet(entry, other):
                raise ArmidError(f"{where}: identifier '{entry.label}' is there twice with the same fitness, noise and "
                                 "seeds, each run once is expected")  # fmt: skip


def meet(entry: Entry, other: Entry) -> bool:
    """Tell whether two entries ask for the same fitness, noise and seed somewhere."""
    pairs = ((entry.fitness, other.fitness), (entry.noise_deg_s, other.noise_deg_s), (entry.seeds, other.seeds))
    return all(set(one) & set(two) for one, two in pairs)


def check_pair(entry: Entry, cases: Sequence[Case], known: Known, where: str) -> None:
    """Refuse a fitness that needs noise where there is none."""
    at = f"{where}, identifier '{entry.label}'"
    simulated = any(case.source is None for case in cases)
    for fitness in entry.fitness:
        if "noise" in known.fitness[fitness].asks and 0.0 in entry.noise_deg_s and simulated:
            raise ArmidError(f"{at}: fitness '{fitness}' needs noise, but noise_deg_s holds 0, levels of its own that "
                             "are above 0 are expected")  # fmt: skip
    if any(entry.noise_deg_s) and any(case.model.plant.output_unit != "rad/s" for case in cases):
        raise ArmidError(f"{at}: noise_deg_s is given, but the plant's speed is no angular one, 0 is expected")
