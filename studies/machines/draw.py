"""Draw a campaign of a machine: what is planted, its records, its sensors, what is wrong; then simulate it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from machines.catalogue import MACHINES, Array, Machine
from machines.excite import KINDS, SMOOTH, excitation
from machines.forms import FORMS, SCALES, Form
from machines.integrate import Planted, simulate
from machines.sensors import DIRT, FAULTS, SMOOTH_DIRT, Sensor, draw_sensor, fault_size, faulty

RATES_HZ = (20.0, 25.0, 40.0, 50.0, 100.0, 125.0, 200.0, 250.0, 400.0, 500.0, 1000.0, 2000.0)
N_EFFECTS = (0.2, 0.4, 0.25, 0.15)
UNLISTED = 0.55
"""Chance that an effect comes in a form that the library does not hold."""
STEP = 1e-3
"""Longest Runge-Kutta step [s]."""
FEWEST, MOST = 150, 6000
"""Samples of a record."""
MOVES = 1.0
"""An effect moves some record by more than so many times its noise."""
WEAKER = (-0.7, 0.0)
"""Decimal logarithm of the factor on a strength, so that weak effects are among them."""
REVISIONS = 6
"""Simulations of one draw: too small an effect is doubled, and a record that goes too far is asked for less."""
SMALLER = 0.7
ATTEMPTS = 60
"""Draws of numbers for one plan; a plan that fails so often has an error."""


@dataclass(frozen=True)
class Plan:
    """Hold what is drawn before anything is simulated."""

    machine: Machine
    listed: tuple[bool, ...]
    n_records: int
    rate_hz: float
    hold: str
    fault: str
    dirt: str
    tolerances: Mapping[str, float]

    @property
    def label(self) -> str:
        return ("control", "single", "two", "three")[len(self.listed)]


@dataclass(frozen=True)
class Drawn:
    """Hold a campaign: numbers, planted effects with what they move, records without noise, sensors and the fault.

    outputs: (n_outputs, n_records, n_samples), with the fault in them. kp: of each record of a controlled machine.
    """

    plan: Plan
    numbers: Mapping[str, Any]
    off: Mapping[str, float]
    planted: tuple[Planted, ...]
    moves: tuple[float, ...]
    times: Array
    kinds: tuple[str, ...]
    roles: tuple[str, ...]
    inputs: Mapping[str, Array]
    outputs: Array
    sensors: tuple[Sensor, ...]
    fault: Mapping[str, Any]


def plan(seed: int, index: int, names: Sequence[str]) -> tuple[Plan, np.random.Generator]:
    """Draw what a campaign is about; machines take turns. Returns the generator for all that follows too."""
    rng = np.random.default_rng([seed, index])
    machine = MACHINES[names[index % len(names)]]
    n_effects = int(rng.choice(len(N_EFFECTS), p=N_EFFECTS))
    rates = [r for r in RATES_HZ if machine.rates_hz[0] <= r <= machine.rates_hz[1]]
    hold = "linear" if rng.random() < 0.2 else "zero"
    known = [name for name in machine.constants if name not in machine.exact]
    tolerances = {name: round(float(rng.uniform(0.0, 0.05)), 3) if rng.random() < 0.7 else 0.0 for name in known}
    n_records = round(float(np.exp(rng.uniform(np.log(2.0), np.log(30.0)))))
    is_faulty = n_records > 3 and rng.random() < 0.25
    dirt = str(rng.choice(DIRT if hold == "zero" else SMOOTH_DIRT))
    return Plan(
        machine, tuple(bool(rng.random() > UNLISTED) for _ in range(n_effects)), n_records, float(rng.choice(rates)),
        hold, str(rng.choice(FAULTS)) if is_faulty else "", dirt, tolerances,
    ), rng  # fmt: skip


def chosen_forms(plan: Plan, rng: np.random.Generator) -> list[Form]:
    """Draw forms of different families from the one list, the family first; some in the library, the others not."""
    found: list[Form] = []
    for listed in plan.listed:
        taken = {form.family for form in found}
        fitting = [f for f in FORMS if f.fits(plan.machine) and f.family not in taken
                   and bool(f.library(plan.machine)) == listed]  # fmt: skip
        family = str(rng.choice(sorted({f.family for f in fitting})))
        of_family = [f for f in fitting if f.family == family]
        found.append(of_family[int(rng.integers(len(of_family)))])
    return found


def drawn_sizes(form: Form, machine: Machine, command: float, h: float, rng: np.random.Generator) -> dict[str, float]:
    """Draw the sizes of a form, SI; a dead time is a whole number of steps."""
    sizes = {}
    for name, (low, high, unit) in form.sizes.items():
        scale = {"command": command, "s/command": 1.0 / command}.get(unit) or SCALES[unit](machine)
        value = scale * (float(np.exp(rng.uniform(np.log(low), np.log(high)))) if low > 0.0 else rng.uniform(low, high))
        value *= float(10.0 ** rng.uniform(*WEAKER)) if name == form.strength else 1.0
        sizes[name] = value * (float(rng.choice([-1.0, 1.0])) if unit == "signed" else 1.0)
    if "delay" in sizes:
        sizes["delay"] = max(round(sizes["delay"] / h), 1) * h
    return sizes


def drawn(plan: Plan, rng: np.random.Generator) -> Drawn:
    """Draw numbers and simulate until every effect moves a record and every record moves; an error after 60 draws."""
    for _ in range(ATTEMPTS):
        found = attempt(plan, rng)
        if found is not None:
            return found
    raise RuntimeError(f"{plan.machine.name}: {ATTEMPTS} draws gave no campaign in which {len(plan.listed)} effects "
                       "move a record by more than its noise")  # fmt: skip


def attempt(plan: Plan, rng: np.random.Generator) -> Drawn | None:
    """Draw numbers and simulate once; None where an effect, or a record, cannot be seen."""
    machine, n = plan.machine, plan.n_records
    numbers: dict[str, Any] = {name: float(f"{rng.uniform(*r):.4g}")
                               for name, r in {**machine.parameters, **machine.constants}.items()}  # fmt: skip
    limit = machine.limit(numbers)
    if "kp" in numbers:
        gains = np.array([numbers["kp"], float(f"{rng.uniform(*machine.constants['kp']):.4g}")])
        numbers["kp"] = gains[rng.integers(0, 2, n)]
    dt = 1.0 / plan.rate_hz
    n_samples = int(np.clip(rng.uniform(*machine.seconds) * plan.rate_hz, FEWEST, MOST))
    n_sub = int(np.ceil(dt / STEP - 1e-9))
    times, h = dt * np.arange(n_samples), dt / n_sub
    allowed = SMOOTH if plan.hold == "linear" else KINDS
    kinds = tuple(str(kind) for kind in rng.choice(allowed, n))
    size = limit * rng.uniform(0.4, 1.0, n)
    slowest = max(0.15, 8.0 * dt, times[-1] / 40.0)
    asked = np.array([excitation(kind, times, slowest, rng) for kind in kinds])
    (commanded,) = (name for name in machine.inputs if name != "supply")
    inputs: dict[str, Array] = dict.fromkeys(machine.inputs, asked)
    if "supply" in machine.inputs:
        full = float(rng.uniform(*machine.extra["supply"]))
        inputs["supply"] = np.round(full * (1.0 - 0.05 * rng.uniform(0.0, 1.0, (n, 1)) * times / times[-1]), 4)
    largest = limit * float(np.mean(numbers["kp"])) if "kp" in numbers else limit
    largest *= float(np.mean(inputs["supply"])) if "supply" in inputs else 1.0
    start = np.zeros((machine.n_states, n))
    if machine.name == "hydraulic_boom":
        start[0] = rng.uniform(-0.4, 0.4, n)
    planted = [Planted(f, drawn_sizes(f, machine, largest, h, rng)) for f in chosen_forms(plan, rng)]
    for _ in range(REVISIONS):
        inputs[commanded] = np.round(size[:, None] * asked, 6)
        runs = compared(plan, numbers, inputs, start, planted, n_sub)
        whole, plain = runs[0], runs[-1]
        is_far = ~(np.max(np.abs(runs[:, 0]), axis=(0, 2)) <= machine.travel)
        if np.any(is_far):
            size = np.where(is_far, SMALLER * size, size)
            continue
        moved, still = (np.sqrt(np.mean((r - r[:, :, :1]) ** 2, axis=2)) for r in (whole, plain))
        state = rng.bit_generator.state
        sensors = tuple(draw_sensor(o.headers, o.unit, float(np.sqrt(np.mean(moved[i] ** 2))), dt, rng)
                        for i, o in enumerate(machine.outputs))  # fmt: skip
        floors = np.array([s.floor for s in sensors])
        if np.any(moved < 0.25 * still) or np.any(moved > 4.0 * still) or np.any(moved < 6.0 * floors[:, None]):
            return None
        changes = np.sqrt(np.mean((runs[1:-1] - whole) ** 2, axis=3))
        moves = np.max(changes / floors[:, None], axis=(1, 2))
        if np.all(moves > MOVES):
            fault, outputs = with_fault(plan, times, whole, sensors, rng)
            off = {name: float(np.clip(rng.normal(), -2.0, 2.0)) * t for name, t in plan.tolerances.items()}
            roles = ["train"] * n
            for i in rng.permutation(n)[: max(1, n // 3)]:
                roles[i] = "holdout"
            return Drawn(plan, numbers, off, tuple(planted), tuple(map(float, moves)), times, kinds, tuple(roles),
                         inputs, outputs, sensors, fault)  # fmt: skip
        rng.bit_generator.state = state
        # twice as strong: a dead time is still a whole number of steps
        doubled = [replace(p, sizes={**p.sizes, p.form.strength: 2.0 * p.sizes[p.form.strength]}) for p in planted]
        planted = [d if m <= MOVES else p for d, p, m in zip(doubled, planted, moves, strict=True)]
    return None


def compared(
    plan: Plan, numbers: Mapping[str, Any], inputs: Mapping[str, Array], start: Array, planted: Sequence[Planted],
    n_sub: int,
) -> Array:  # fmt: skip
    """Return outputs with all effects, without each, and without any, (n_effects + 2, n_outputs, n_records, n_samples).

    Everything runs side by side.
    """
    n, variants = plan.n_records, len(planted) + 2
    there = []
    for i, each in enumerate(planted):
        weight = np.linspace(0.0, 1.0, n) if each.form.by_record else np.ones(n)
        on = np.tile(weight, (variants, 1))
        on[[i + 1, -1]] = 0.0
        there.append(replace(each, on=on.ravel()))
    tiled = {name: np.tile(value, variants) if np.ndim(value) else value for name, value in numbers.items()}
    found = simulate(plan.machine, tiled, {k: np.tile(v, (variants, 1)) for k, v in inputs.items()},
                     1.0 / plan.rate_hz, n_sub, plan.hold, there, np.tile(start, variants))[:, :, ::n_sub]  # fmt: skip
    return np.array([found[:, k * n : (k + 1) * n] for k in range(variants)])


def with_fault(
    plan: Plan, times: Array, outputs: Array, sensors: Sequence[Sensor], rng: np.random.Generator
) -> tuple[dict[str, Any], Array]:
    """Return the fault of one record as the key tells it, and the outputs with it in the first output."""
    if not plan.fault:
        return {}, outputs
    place = int(rng.integers(plan.n_records))
    clean, floor = outputs[0, place], sensors[0].floor
    size = fault_size(plan.fault, times, clean, floor, rng)
    broken = outputs.copy()
    broken[0, place] = faulty(plan.fault, size, times, clean)
    moves = float(np.sqrt(np.mean((broken[0, place] - clean) ** 2))) / floor
    return {"kind": plan.fault, "place": place, "size": size, "moves": moves}, broken
