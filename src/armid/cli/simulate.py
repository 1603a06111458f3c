"""`armid simulate`: what a model does in each record of a campaign."""

import warnings
from pathlib import Path

import click
import numpy as np
from numpy.typing import NDArray

from armid.cli.options import (
    accuracy_of,
    accuracy_option,
    campaign_argument,
    effects_option,
    examples,
    numbers,
    opened,
    out_option,
    plugin_option,
)
from armid.cli.report import NewFiles
from armid.engine import accuracy_against, calibrate, simulate
from armid.errors import ArmidError, nearest
from armid.model import Model
from armid.record import Campaign, Override, Piece, Record, write_table

Array = NDArray[np.float64]
SIGNAL = {"rad/s": "angular_velocity_rad_s", "m/s": "velocity_m_s"}


@click.command("simulate", epilog=examples(
    "armid simulate studies/campaigns/paper_arm --set p0=3.1e6 --out results/simulated",
    "armid simulate CAMPAIGN --effects coulomb --set coulomb.level=40 --out DIR",
))  # fmt: skip
@campaign_argument
@out_option("Folder to write to.", required=True)
@click.option("--set", "settings", multiple=True, metavar="NAME=VALUE", help="Value of a parameter, SI. Repeatable.")
@effects_option
@accuracy_option
@plugin_option
def simulate_command(
    campaign: Path, out: Path, settings: tuple[str, ...], effects: str, accuracy: str, plugins: tuple[str, ...]
) -> None:
    """Simulate every record of a campaign.

    Writes DIR/<record's file name>. Columns: time_s (the record's times from 0 on; the even grid of a record whose
    times are irregular), the states, and the recorded signal, SI. A parameter that is not set takes the value that the
    campaign fixes, else its nominal one.
    """
    _, read, model, *_ = opened(campaign, effects, plugins)
    candidate = candidate_of(model, read, numbers(settings, "--set"))
    wanted = accuracy_of(accuracy)
    with NewFiles(out) as files:
        for record in read.records:
            write_table(files.path(record.file), simulated_table(record, model, candidate, wanted))
    for name, value in zip(model.parameters, candidate, strict=True):
        print(f"{name} = {value:.9g} {model.parameters[name].unit}")
    for record in read.records:
        if record.irregularity is not None:
            print(f"{record.file}: on its even grid of {record.manoeuvre.interval:.6g} s, as its times are irregular")
    print(f"wrote {len(read.records)} files to {out}")


def candidate_of(model: Model, campaign: Campaign, given: dict[str, float]) -> Array:
    """Return the whole candidate: given values, then what the campaign fixes, then nominal and null values.

    Raises ArmidError for an unknown name, a value that is not finite, and a parameter without any value.
    """
    for name, value in given.items():
        if name not in model.parameters:
            raise ArmidError(f"--set: parameter '{name}' is not in the model: {nearest(name, model.parameters)}")
        if not np.isfinite(value):
            raise ArmidError(f"--set {name}: {value} was found, a finite number is expected")
    values = []
    for name, p in model.parameters.items():
        choices = (given.get(name), campaign.parameters.get(name, Override()).fixed, p.nominal, p.null, p.fixed)
        known = [v for v in choices if v is not None]
        if not known:
            raise ArmidError(f"parameter '{name}' has no nominal value: --set {name}=VALUE is expected ({p.unit})")
        values.append(known[0])
    return np.array(values)


def simulated_table(record: Record, model: Model, candidate: Array, accuracy: str | None) -> dict[str, Array]:
    parts = [simulated_piece(p, record, model, candidate, accuracy) for p in record.whole_pieces]
    table = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    shown = table["time_s"] > -1e-3 * record.manoeuvre.interval
    return {name: values[shown] for name, values in table.items()}


def simulated_piece(
    piece: Piece, record: Record, model: Model, candidate: Array, accuracy: str | None
) -> dict[str, Array]:
    wanted = accuracy or accuracy_against(record.noise.rms, model)
    calibration = calibrate(model, piece.manoeuvre, candidate[np.newaxis], wanted, spans=False)
    run = simulate(model, piece.manoeuvre, candidate[np.newaxis], calibration.schedule, states=True)
    if run.failed[0]:
        raise ArmidError(f"record '{record.file}': the simulation diverges with these parameters")
    if not calibration.reached:
        off = f"the engine is off by up to {calibration.error:.2g} {model.plant.output_unit} even at its finest steps"
        warnings.warn(f"{record.file}: {off}: with these parameters the equations are stiff", stacklevel=2)
    speed = model.plant.aliases.get("omega", "omega")
    table = {"time_s": piece.manoeuvre.times()}
    for name, state in model.states.items():
        if name == speed:
            table[SIGNAL[model.plant.output_unit]] = run.output[0]
        elif state.column:
            table[state.column] = run.states[name][0]
    table.setdefault(SIGNAL[model.plant.output_unit], run.output[0])
    if speed in model.states and any("output" in e.adds for e in model.effects):
        table[model.states[speed].column or f"{speed}_state"] = run.states[speed][0]
    return table
