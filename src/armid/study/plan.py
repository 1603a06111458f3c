"""Every run that a study asks for, in the order in which they are performed."""

import hashlib
from collections.abc import Iterator
from dataclasses import asdict
from typing import Any, NamedTuple

from armid.study.cases import Case
from armid.study.study import Entry, Study, canonical, window_text

# Hexadecimal digits of a run's id: two of a million runs meet with a probability of 1e-8.
ID_LENGTH = 16


class Planned(NamedTuple):
    """A run: its id, its settings (JSON), and the words under which it is reported.

    noise_deg_s: None for records that are read; they keep the noise that they have.
    """

    run: str
    settings: str
    case: str
    identifier: str
    fitness: str
    noise_deg_s: float | None
    window: str
    seed: int
    budget: int


def planned_runs(study: Study) -> Iterator[Planned]:
    """Yield the runs, seed by seed, so that a study that is broken off has tried everything about equally often."""
    seeds = sorted({seed for entry in study.entries for seed in entry.seeds})
    shared = {case.name: case_settings(study, case) for case in study.cases}
    for seed in seeds:
        for case in study.cases:
            for entry in study.entries:
                if seed in entry.seeds:
                    yield from runs_of(study, case, shared[case.name], entry, seed)


def runs_of(study: Study, case: Case, shared: dict[str, Any], entry: Entry, seed: int) -> Iterator[Planned]:
    """Yield the runs of one entry on one case with one seed."""
    for window in study.sheet.windows_s:
        for noise in entry.noise_deg_s if case.source is None else (None,):
            for fitness in entry.fitness:
                own = study.known.own("fitness", fitness) | study.known.own("identifiers", entry.name)
                settings = canonical(shared | {
                    "identifier": entry.name, "options": dict(entry.options), "budget": entry.budget,
                    "fitness": fitness, "noise_deg_s": noise, "window_s": window, "seed": seed,
                    "own": shared["own"] | own,
                })  # fmt: skip
                run = hashlib.sha256(settings.encode()).hexdigest()[:ID_LENGTH]
                words = (case.name, entry.label, fitness, noise, window_text(window))
                yield Planned(run, settings, *words, seed, entry.budget)


def case_settings(study: Study, case: Case) -> dict[str, Any]:
    """Return the settings that the runs on a case have in common: all that decides their results."""
    plant, effects = study.sheet.plant, [e.name for e in case.model.effects]
    settings: dict[str, Any] = {
        "kind": study.sheet.kind, "case": case.name, "plant": plant, "effects": effects, "bounds": case.bounds,
        "fixed": case.fixed, "accuracy": study.sheet.accuracy,
        "own": study.known.own("plants", plant) | study.known.own("effects", *effects),
    }  # fmt: skip
    if case.source is not None:
        return settings | {"campaign": asdict(case.source)}
    strokes = [{"constants": s.constants, "duration_s": s.duration_s, "role": s.role} for s in case.strokes]
    return settings | {
        "truth": case.truth, "strokes": strokes, "interval_s": study.sheet.interval_s,
        "noise_seed": study.sheet.noise_seed,
    }  # fmt: skip
