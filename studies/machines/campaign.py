"""Write a drawn campaign: campaign.toml and a CSV file a record, and what the key tells of it."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from machines.draw import Drawn
from machines.forms import FORMS
from machines.sensors import kept_rows

SAID = (
    "SYNTHETIC and blind: a simulated machine; no machine was measured, and the truth is not written here.",
    "The plant is a plugin: --plugin studies/machines/plants.py:{plant}",
)
JITTER, MOST_JITTER = 0.05, 0.2
"""Rms and largest deviation of the time of a sample, in intervals."""


def files_of(name: str, drawn: Drawn, rng: np.random.Generator) -> tuple[dict[str, str], dict[str, Any]]:
    """Return file -> text, which tell nothing of the truth, and the entry of the key."""
    files, records, noises = {}, [], []
    for i in range(drawn.plan.n_records):
        file = f"r{i:02d}.csv"
        files[file], noise = record_text(drawn, i, rng)
        noises.append(noise)
        records.append({"file": file, "role": drawn.roles[i], "excitation": drawn.kinds[i], "noise": noise})
    return {"campaign.toml": campaign_text(name, drawn), **files}, entry_of(drawn, records)


def record_text(drawn: Drawn, i: int, rng: np.random.Generator) -> tuple[str, dict[str, float]]:
    """Return a record as CSV, and output -> rms of its noise [SI]."""
    machine, times = drawn.plan.machine, drawn.times
    driven = np.array([values[i] for values in drawn.inputs.values()])
    rows, values = kept_rows(drawn.plan.dirt, driven, rng), drawn.outputs[:, i]
    if drawn.plan.dirt == "jitter":
        dt = times[1]
        moved = times + dt * np.clip(JITTER * rng.standard_normal(times.size), -MOST_JITTER, MOST_JITTER)
        moved[0], moved[-1] = times[0], times[-1]
        moved = np.round(moved, 6)
        values = np.array([CubicSpline(times, y)(moved) for y in values])
        driven = np.array([np.interp(moved, times, u) for u in driven])
        times = moved
    columns, noise = [times[rows]], {}
    for output, y, sensor in zip(machine.outputs, values, drawn.sensors, strict=True):
        column, error = sensor.column(y, rng)
        columns.append(column[rows])
        noise[output.name] = float(np.sqrt(np.mean(error[rows] ** 2)))
    headers = ["time_s", *(s.header for s in drawn.sensors), *machine.inputs.values()]
    lines = [",".join(headers)]
    lines += [",".join(text(v) for v in row) for row in zip(*columns, *driven[:, rows], strict=True)]
    return "\n".join([*lines, ""]), noise


def text(value: float) -> str:
    """Write a number with at most nine digits, -0 as 0."""
    return f"{value + 0.0:.9g}"


def campaign_text(name: str, drawn: Drawn) -> str:
    """Return campaign.toml; constants stand there as the user knows them, off by what the key tells."""
    machine, counts = drawn.plan.machine, [s.counts for s in drawn.sensors if s.counts]
    lines = [*(f"# {line.format(plant=machine.name)}" for line in SAID), "", f'name = "{name}"',
             f'plant = "{machine.name}"', f'hold = "{drawn.plan.hold}"']  # fmt: skip
    lines += [f"counts_per_turn = {counts[0]}"] if counts else []
    inputs = [f'{key} = "{header}"' for key, header in machine.inputs.items()]
    lines += ["", "[inputs]", *inputs, "", "[constants]"]
    lines += [f"{key} = {declared(drawn, key)!r}" for key in machine.constants if key not in machine.exact]
    lines += ["", "[tolerances]", *(f"{key} = {value!r}" for key, value in drawn.plan.tolerances.items())]
    for i, role in enumerate(drawn.roles):
        lines += ["", "[[records]]", f'file = "r{i:02d}.csv"', f'role = "{role}"']
        own = {key: float(drawn.numbers[key][i]) for key in machine.exact}
        lines += ["[records.constants]", *(f"{key} = {value!r}" for key, value in own.items())] if own else []
    return "\n".join([*lines, ""])


def declared(drawn: Drawn, name: str) -> float:
    """Return the value of a constant as the campaign states it."""
    return float(f"{drawn.numbers[name] * (1.0 + drawn.off[name]):.6g}")


def entry_of(drawn: Drawn, records: list[dict[str, Any]]) -> dict[str, Any]:
    """Return what the key tells: machine, truth, effects, fault, constants, noise."""
    plan, machine = drawn.plan, drawn.plan.machine
    fault: Mapping[str, Any] = drawn.fault
    if fault:
        place = fault["place"]
        fault = {"kind": fault["kind"], "record": records[place]["file"], "role": records[place]["role"],
                 "size": fault["size"], "moves": fault["moves"]}  # fmt: skip
    first, rms = drawn.sensors[0], {o.name: s.floor for o, s in zip(machine.outputs, drawn.sensors, strict=True)}
    return {
        "class": plan.label,
        "machine": machine.name,
        "left_out": machine.left_out,
        "parameters": {name: drawn.numbers[name] for name in machine.parameters},
        "effects": [effect_entry(drawn, i) for i in range(len(drawn.planted))],
        "constants": {name: share for name, share in drawn.off.items() if share},
        "tolerances": dict(plan.tolerances),
        "fault": dict(fault),
        "dirt": plan.dirt,
        "rate_hz": plan.rate_hz,
        "hold": plan.hold,
        "noise": {"kind": first.kind, "rms": rms, "step": first.step, "held_samples": first.hold},
        "floor": {role: floor(records, role) for role in ("train", "holdout")},
        "records": records,
        "declared_fit": None,
    }  # fmt: skip


def floor(records: list[dict[str, Any]], role: str) -> float | None:
    """Return the rms of the noise over the records of a role and all outputs [SI], None without a record."""
    squares = [value**2 for r in records if r["role"] == role for value in r["noise"].values()]
    return float(np.sqrt(np.mean(squares))) if squares else None


def effect_entry(drawn: Drawn, i: int) -> dict[str, Any]:
    """Return a planted effect: the name in armid's library, or family and form where the library lacks the form.

    library: sets of effects, each of which has the form; all of a set are needed.
    """
    planted, machine = drawn.planted[i], drawn.plan.machine
    form, library = planted.form, planted.form.library(machine)
    # behind a linear machine alone, a lag of the sensor is a lag of the drive
    if library and form.family == "lag" and machine.linear and len(drawn.planted) == 1:
        others = ("voltage", "sensor") if form.form in ("voltage", "sensor") else ()
        alike = [f.library(machine) for f in FORMS if f.family == "lag" and f.form in others and f is not form]
        library = (*library, *(names for sets in alike for names in sets))
    return {
        "name": library[0][0] if library else f"{form.family}:{form.form}",
        "family": form.family,
        "form": form.form,
        "port": form.place,
        "listed": bool(library),
        "matching": bool(library),
        "library": [list(names) for names in library],
        "strength": planted.sizes[form.strength],
        "sizes": dict(planted.sizes),
        "moves": drawn.moves[i],
        "source": form.source,
    }
