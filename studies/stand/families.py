"""Make campaigns as real ones are: one record that differs, constants that are off, broken samples, sets of effects.

    python studies/stand/families.py OUT_FOLDER --seed 1 --suite studies/blind.toml fault=200 constant=100 constants=100

The truth lies in OUT_FOLDER.key.json, in the form of a blind suite: `class` is the family, `fault` tells the record and
what was done to it, `constants` by how much they are off. Sizes are drawn; all of them are estimates of what happens.
"""

import argparse
import math
import sys
from collections.abc import Sequence
from copy import deepcopy
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import numpy as np

from stand import RefusalError
from stand.arm import PARAMETERS, Arm
from stand.blind.campaign import SUITE, campaign_files, entry_of, measure_strokes
from stand.blind.draw import Drawn, draw_arm, run, six_strokes
from stand.blind.many import Entry, key_path, make_as_told, suite_parser, write_campaigns
from stand.blind.suite import Case, Planted, Suite, read_suite, signed
from stand.campaign import EXACT, record_text
from stand.effects import Effects
from stand.gyro import Gyro, rms
from stand.motion import Motion

FAULTS = ("late", "start", "offset", "drift", "gain", "label", "clipped", "gap", "spikes", "stuck")
DIRT = ("none", "jitter", "hum", "gap")
# Sets of three effects of different ports, which are told apart on six strokes.
THREE = (
    ("coulomb", "flux_saturation", "tachometer_lag"), ("viscous", "gas_heat_loss", "tilt"),
    ("quadratic_drag", "supply_sag", "controller_delay"), ("shell_rocking", "brush_drop", "gas_heat_loss"),
    ("stribeck", "flux_saturation", "gyro_lag"),
)  # fmt: skip
FAMILIES = ("control", "fault", "constant", "constants", "two", "three", "trend", "one", "unlisted", "drawn", "wrong")
# Families whose constants are exact in every other campaign, and known to the plant's own tolerances in the others.
BY_TURNS = ("control", "one", "unlisted")
# Standard deviation to which constants are declared where they are drawn from it, and where one is off by three.
DECLARED = (0.02, 0.05)
# An effect that moves no record by more than its noise is hardly there: the arm is drawn anew until each does.
LEAST = 1.0
# By how much a parameter changes from the first record to the last in a trend.
TREND = (0.02, 0.08)


def make(suite: Suite, seed: int, case: tuple[str, int]) -> tuple[dict[str, str], Entry]:
    """Make the files of one campaign of a family, and its entry in the key."""
    family, index = case
    rng = np.random.default_rng([seed, FAMILIES.index(family), index])
    planted = planted_in(suite, family, index, rng)
    truth = Case(index, family, planted, bool(index % 2))
    gyro = Gyro(round(float(rng.uniform(*suite.noise_deg_s)), 4), 0.001, suite.bandwidth_hz if index % 2 else 0.0)
    fault = {"kind": FAULTS[index // 2 % len(FAULTS)]} if family == "fault" else {}
    while True:
        deviation = float(rng.uniform(*DECLARED)) if family in ("drawn", "wrong") else 0.0
        arm, off = off_constants(draw_arm(suite, rng), family, rng, deviation)
        strokes, duration = six_strokes(rng), round(float(rng.uniform(*suite.duration_s)), 2)
        place = int(rng.integers(len(strokes)))
        moved = [differing(m, fault, rng) if i == place else m for i, (m, _) in enumerate(strokes)]
        trend = {} if family != "trend" else {
            "kind": "trend", "parameter": PARAMETERS[index % len(PARAMETERS)],
            "size": float(rng.uniform(*TREND) * rng.choice([-1.0, 1.0]))}  # fmt: skip
        trained = [m for m, role in strokes if role == "train"]
        arms = [changed(arm, trend["parameter"], trend["size"] * (trained.index(m) / (len(trained) - 1) - 0.5))
                if trend and m in trained else arm for m, _ in strokes]  # fmt: skip
        found = [run(Motion(a, m, truth.effects()), duration) for a, m in zip(arms, moved, strict=True)]
        told = run(Motion(arm, strokes[place][0], truth.effects()), duration)
        if told is None or not all(found):
            continue
        drawn = Drawn(arm, strokes, duration, gyro, tuple(f for f in found if f is not None))
        rests = [replace(truth, planted=tuple(p for p in planted if p is not each)) for each in planted]
        if all(moves(drawn, truth.effects(), rest.effects()) > LEAST for rest in rests):
            break
    records = measure_strokes(suite, drawn, truth.effects(), rng)
    dirt = DIRT[index // 2 % len(DIRT)] if family == "control" else "none"
    for i, each in enumerate(records):
        table = np.column_stack([each.time_s, each.speed_deg_s])
        if i == place and fault:
            fault |= {"record": each.file, "role": each.role}
            shown, real = (np.degrees(t.gyro) for t in (told, drawn.trajectories[i]))
            rest = len(table) - len(real)
            clean = np.concatenate([np.zeros(rest), real])
            there = broken(np.column_stack([table[:, 0], clean]), clean, dict(fault), deepcopy(rng))
            change = np.interp(table[rest:, 0], *there.T) - shown
            table = broken(table, clean, fault, rng)
            fault["moves"] = rms(change) / gyro.noise_deg_s
        if dirt != "none":
            table = dirtied(table, dirt, rng)
        records[i] = replace(each, time_s=table[:, 0], speed_deg_s=table[:, 1])
    is_exact = family in BY_TURNS and bool(index // 4 % 2)
    sheet_of = EXACT if is_exact else ("", "[tolerances]", f"default = {deviation:.6g}") if deviation else ()
    files = campaign_files(f"{family} {index}", gyro, records, sheet_of)
    # a record that is clipped for long is refused otherwise
    sheet = "campaign.toml"
    files[sheet] = files[sheet].replace("\ngyro_range", "\nmost_lost = 0.9\ngyro_range", 1)
    if dirt == "jitter":
        files |= {each.file: record_text(each, gyro.decimals, 6) for each in records}
    if trend:
        there = truth.effects()
        fault = trend | {"record": f"{trained[-1].name}.csv", "role": "train", "moves": moves(drawn, there, there)}
    entry = entry_of(truth, drawn, records) | {"fault": fault, "constants": off, "dirt": dirt, "exact": is_exact}
    return files, entry


def planted_in(suite: Suite, family: str, index: int, rng: np.random.Generator) -> tuple[Planted, ...]:
    """Return the effects of a campaign: those of a set at their largest, or one of all kinds and strengths."""
    singles = {"one": suite.effects, "unlisted": suite.unlisted}.get(family)
    if singles:
        each = [(kind, strength) for kind in singles for strength in range(1, 1 + len(kind.sizes))]
        return (signed(*each[int(rng.integers(len(each)))], rng),)
    sets = {"two": suite.pairs, "three": THREE}.get(family, ((),))
    return tuple(signed(suite.kind(name), len(suite.kind(name).sizes), rng) for name in sets[index % len(sets)])


def moves(drawn: Drawn, effects: Effects, others: Effects) -> float:
    """Return by how many times the noise the record moves that changes most when other effects are there, infinite
    where one cannot be simulated.
    """
    there = [run(Motion(drawn.arm, m, others), drawn.duration_s) for m, _ in drawn.strokes]
    bias = effects.gyro_bias_deg_s - others.gyro_bias_deg_s
    changes = [math.inf if b is None else rms(np.degrees(a.gyro - b.gyro) + bias)
               for a, b in zip(drawn.trajectories, there, strict=True)]  # fmt: skip
    return max(changes) / drawn.gyro.noise_deg_s


def changed(arm: Any, name: str, share: float) -> Any:
    """Return the arm with one of its numbers, or of its loads' (LOAD.NUMBER), changed by a share."""
    load, dot, part = name.partition(".")
    value = changed(getattr(arm, load), part, share) if dot else getattr(arm, name) * (1.0 + share)
    return replace(arm, **{load: value})


def off_constants(
    arm: Arm, family: str, rng: np.random.Generator, deviation: float
) -> tuple[Arm, dict[str, float]]:  # fmt: skip
    """Return the arm with one constant, or with all, off by 2 to 5 %; and by how much.

    drawn: all are off by normal deviates of the declared deviation. wrong: one is off by three of them.
    """
    if not family.startswith("constant") and not deviation:
        return arm, {}
    plain = [name for name, value in vars(arm).items() if isinstance(value, float) and name not in PARAMETERS]
    names = [*plain, *(f"{load}.{part}" for load in ("loaded", "empty") for part in ("mass", "lever", "inertia"))]
    chosen = names if family in ("constants", "drawn") else [names[int(rng.integers(len(names)))]]
    if family == "drawn":
        off = {name: float(deviation * rng.standard_normal()) for name in chosen}
    else:
        size = partial(rng.uniform, *((0.02, 0.05) if not deviation else (3.0 * deviation, 3.0 * deviation)))
        off = {name: float(size() * rng.choice([-1.0, 1.0])) for name in chosen}
    for name, share in off.items():
        arm = changed(arm, name, share)
    return arm, off


def differing(manoeuvre: Any, fault: dict[str, Any], rng: np.random.Generator) -> Any:
    """Return what the arm really did in the record at fault, where that is not what was told."""
    if fault.get("kind") == "start":
        fault["size"] = float(rng.uniform(0.5, 2.0) * rng.choice([-1.0, 1.0]))
        return replace(manoeuvre, start_deg=manoeuvre.start_deg + fault["size"])
    return replace(manoeuvre, shell=not manoeuvre.shell) if fault.get("kind") == "label" else manoeuvre


def broken(table: Any, clean: Any, fault: dict[str, Any], rng: np.random.Generator) -> Any:
    """Return the samples of the record at fault, times [s] and speeds [deg/s]; clean: the speeds without noise."""
    kind, time, speed = fault["kind"], table[:, 0], table[:, 1].copy()
    sign, moving = float(rng.choice([-1.0, 1.0])), np.flatnonzero(time >= 0.0)
    first = int(rng.integers(moving[0], moving[len(moving) * 3 // 4]))
    if kind == "late":
        fault["size"] = sign * float(rng.uniform(0.002, 0.01))
        speed += np.interp(time - fault["size"], time, clean) - clean
    elif kind in ("offset", "drift"):
        fault["size"] = sign * float(rng.uniform(0.5, 2.0))
        speed += fault["size"] * (1.0 if kind == "offset" else np.maximum(time, 0.0))
    elif kind == "gain":
        fault["size"] = sign * float(rng.uniform(0.01, 0.04))
        speed *= 1.0 + fault["size"]
    elif kind == "clipped":
        fault["size"] = float(rng.uniform(0.6, 0.9)) * float(np.abs(speed).max())
        speed = np.clip(speed, -fault["size"], fault["size"])
    elif kind == "spikes":
        places = rng.choice(moving, int(rng.integers(3, 12)), replace=False)
        speed[places] += rng.uniform(20.0, 120.0, len(places)) * rng.choice([-1.0, 1.0], len(places))
        fault["size"] = len(places)
    elif kind == "stuck":
        fault["size"] = int(rng.integers(20, 80))
        speed[first : first + fault["size"]] = speed[first]
    elif kind == "gap":
        fault["size"] = int(rng.integers(30, 120))
        return np.delete(np.column_stack([time, speed]), slice(first, first + fault["size"]), axis=0)
    return np.column_stack([time, speed])


def dirtied(table: Any, dirt: str, rng: np.random.Generator) -> Any:
    """Return samples of a sound record as bad cables and clocks make them."""
    time, speed = table[:, 0].copy(), table[:, 1].copy()
    if dirt == "hum":
        speed += 0.15 * np.sin(2.0 * math.pi * (50.0 * time + rng.random()))
    if dirt == "gap":
        lost = rng.choice(len(time), 15, replace=False)
        return np.delete(table, lost, axis=0)
    return np.column_stack([time + (rng.normal(0.0, 2e-5, len(time)) if dirt == "jitter" else 0.0), speed])


def main(words: Sequence[str]) -> int:
    """Make the campaigns of some families as the command line says; give the exit code, 2 when refused."""
    parser = suite_parser("stand/families.py", "Make campaigns as real ones are.", SUITE)
    parser.add_argument("families", nargs="+", metavar="FAMILY=N", help=", ".join(FAMILIES))
    return make_as_told(_make_families, words, parser)


def _make_families(options: argparse.Namespace) -> str:
    wanted = []
    for text in options.families:
        family, _, count = text.partition("=")
        if family not in FAMILIES or not count.isdecimal():
            raise RefusalError(
                f"{text!r} is not a FAMILY=N: one of {', '.join(FAMILIES)} with a whole number is expected"
            )
        wanted.append((family, int(count)))
    # In turn, so that a study that is cut short has seen all families alike.
    parts = [((index + 0.5) / count, family, index) for family, count in wanted for index in range(count)]
    named = {f"c{place:03d}": (family, index) for place, (_, family, index) in enumerate(sorted(parts))}
    write_campaigns(options, named, partial(make, read_suite(options.suite), options.seed))
    return f"{options.folder}: {len(named)} campaigns, SYNTHETIC; key: {key_path(options.folder)}"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
