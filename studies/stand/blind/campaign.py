"""Make one blind campaign, and apart from it what the scorer must know."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from stand.blind.case import Case
from stand.blind.draw import Drawn, draw
from stand.blind.suite import Planted, Suite
from stand.blind.weight import Weight, brief, weigh, weigh_alone
from stand.campaign import Record, record_lines, record_text
from stand.effects import Effects
from stand.gyro import measure, record_times
from stand.settings import short
from stand.trajectory import SAMPLES_PER_SECOND

Entry = dict[str, Any]
SAID = "SYNTHETIC and blind: a simulated shell transfer arm; no machine was measured, and the truth is not told here."


@dataclass(frozen=True)
class Measured:
    """Hold a record as written, and the rms of its noise from t = 0 on [rad/s]."""

    record: Record
    noise: float


def make_campaign(name: str, suite: Suite, case: Case, seed: int) -> tuple[dict[str, bytes], Entry]:
    """Make the files of a campaign, which tell nothing of its truth, and its entry in the key."""
    drawn = draw(suite, case, np.random.default_rng([seed, 2, case.index]))
    rng = np.random.default_rng([seed, 3, case.index])
    rest = round(suite.rest_s * SAMPLES_PER_SECOND)
    measured = [measure_stroke(drawn, place, case.effects(), rest, rng) for place in range(len(drawn.strokes))]
    texts = {each.record.file: record_text(each.record, drawn.gyro.decimals) for each in measured}
    texts |= {"campaign.toml": campaign_text(name, drawn, measured), "README.md": f"# {name}\n\n{SAID}\n"}
    return {file: text.encode() for file, text in texts.items()}, _entry(suite, case, drawn, measured)


def measure_stroke(drawn: Drawn, place: int, effects: Effects, rest: int, rng: np.random.Generator) -> Measured:
    """Measure one stroke; what is written departs from the truth by noise and rounding."""
    (manoeuvre, role), trajectory = drawn.strokes[place], drawn.trajectories[place]
    speed = measure(trajectory, drawn.gyro, effects.gyro_bias_deg_s, rng, rest)
    departure = np.radians(speed[rest:]) - trajectory.gyro
    repeated = "lower.csv" if manoeuvre.name == "again" else None
    record = Record(f"{manoeuvre.name}.csv", manoeuvre, role, record_times(trajectory, rest), speed, repeated)
    return Measured(record, float(np.sqrt(np.mean(departure**2))))


def campaign_text(name: str, drawn: Drawn, measured: list[Measured]) -> str:
    """Write campaign.toml without a word about the truth."""
    lines = [f"# {SAID}", "", f'name = "{name}"', 'plant = "shell_transfer_arm"']
    lines.append(f"gyro_range_deg_s = {short(drawn.gyro.range_deg_s)}")
    for each in measured:
        lines += ["", "[[records]]", *record_lines(each.record)]
    return "\n".join([*lines, ""])


def _entry(suite: Suite, case: Case, drawn: Drawn, measured: list[Measured]) -> Entry:
    """Give the truth of a campaign, the noise in its records, and what its effects do to the held-out error.

    Speeds in rad/s; `declared_fit` is the stand's own fit of the declared model to the strokes without their noise.
    """
    floor = {role: _pooled([m.noise for m in measured if m.record.role == role]) for role in ("train", "holdout")}
    speeds = np.array([each.gyro for each in drawn.trajectories])
    joint = weigh(drawn, speeds, suite.ranges) if case.planted else None
    alone = [joint] if len(case.planted) == 1 else [_alone(suite, drawn, each) for each in case.planted]
    effects = [_told(*pair, floor["holdout"]) for pair in zip(case.planted, alone, strict=True)]
    raw = joint.raw if joint else (0.0,) * len(measured)
    return {
        "class": case.label,
        "index": case.index,
        "parameters": {name: getattr(drawn.arm, name) for name in suite.ranges},
        "effects": effects,
        "noise": {
            "kind": "coloured" if case.coloured else "white",
            "rms_deg_s": drawn.gyro.noise_deg_s,
            "bandwidth_hz": drawn.gyro.noise_bandwidth_hz or None,
        },
        "floor": floor,
        "records": [_record(*pair) for pair in zip(measured, raw, strict=True)],
        "declared_fit": _fitted(joint, drawn, floor["holdout"]) if joint else None,
    }


def _alone(suite: Suite, drawn: Drawn, planted: Planted) -> Weight | None:
    return weigh_alone(drawn, Effects(**planted.sizes), suite.ranges)


def _told(planted: Planted, alone: Weight | None, floor: float | None) -> Entry:
    """Tell of one effect: what it is, and what it alone does to the best fit of the declared model."""
    kind = planted.kind
    return {
        "name": kind.name,
        "port": kind.port,
        "form": kind.form,
        "matching": kind.matching,
        "listed": kind.listed,
        "strength": planted.strength,
        "sizes": dict(planted.sizes),
        "alone": alone.told(floor) if alone else None,
    }


def _fitted(weight: Weight, drawn: Drawn, floor: float | None) -> Entry:
    """Tell of the declared model's fit, with the relative error of each parameter."""
    found = {name: getattr(weight.arm, name) for name in ("p0", "k", "eta3", "n")}
    off = {name: value / getattr(drawn.arm, name) - 1.0 for name, value in found.items()}
    return {
        "parameters": {name: brief(value) for name, value in found.items()},
        "bias": {name: brief(value) for name, value in off.items()},
        **weight.told(floor),
    }


def _record(measured: Measured, raw: float) -> Entry:
    record, told = measured.record, measured.record.manoeuvre
    return {
        "file": record.file,
        "role": record.role,
        "start_angle_deg": told.start_deg,
        "target_angle_deg": told.target_deg,
        "shell": told.shell,
        "supply_V": told.supply_volt,
        "noise": brief(measured.noise),
        "raw_change": brief(raw),
    }


def _pooled(values: list[float]) -> float | None:
    """Give the rms over records of equal length, None over none."""
    return brief(float(np.sqrt(np.mean(np.square(values))))) if values else None
