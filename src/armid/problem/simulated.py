"""One candidate simulated through every record of a campaign."""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from armid.engine import accuracy_against, calibrate, simulate
from armid.errors import DataError, ModelError, nearest, quoted
from armid.model import Array, Model, Output
from armid.record import Campaign, Override, Piece, Record, write_table
from armid.report.document import Document, Figure, Section, listed, record_axes, table
from armid.report.result import NewFiles, Shown
from armid.report.style import detached

if TYPE_CHECKING:
    from pandas import DataFrame


@dataclass(frozen=True, eq=False, repr=False)
class SimulatedCampaign(Shown):
    """Hold what one candidate does in every record of a campaign; it prints itself.

    candidate: whole, SI. tables: file -> header -> values, SI: time_s, the states, the recorded signal.
    """

    campaign: Campaign
    model: Model
    candidate: Array
    tables: Mapping[str, Mapping[str, Array]]

    def to_dict(self) -> dict[str, Any]:
        """Return the parameters and the columns of each record, SI."""
        records = {file: {key: values.tolist() for key, values in columns.items()}
                   for file, columns in self.tables.items()}  # fmt: skip
        return {"campaign": self.campaign.name, "parameters": self.parameters, "records": records}

    @property
    def parameters(self) -> dict[str, float]:
        """Name -> value, SI."""
        return dict(zip(self.model.parameters, map(float, self.candidate), strict=True))

    @property
    def table(self) -> "DataFrame":
        """All records below each other, SI, with the file of each row."""
        from pandas import DataFrame, concat

        frames = [DataFrame({"record": file, **columns}) for file, columns in self.tables.items()]
        return concat(frames, ignore_index=True)

    def document(self) -> Document:
        """Return the parameters and the size of each record."""
        model = " + ".join([self.model.plant.name, *(e.name for e in self.model.effects)])
        outputs = [si_header(output)[0] for output in self.model.plant.outputs]
        rows = [(file, str(len(columns["time_s"])), *(f"{np.abs(columns[o]).max():.4g}" for o in outputs))
                for file, columns in self.tables.items()]  # fmt: skip
        values = listed([f"{name} = {value:.6g} {self.model.parameters[name].unit}".removesuffix(" 1")
                         for name, value in self.parameters.items()])  # fmt: skip
        answer = f"{model} simulated through {len(rows)} records of {self.campaign.name} with {values}."
        sizes = table("Records", ["record", "samples", *(f"largest {output}" for output in outputs)], rows)
        drawn = Figure("simulated", "Simulated and measured", "", self.plot)
        return Document(self.campaign.name, "Simulation", "", (answer,), (Section("Records", (sizes, drawn)),),
                        main=(sizes,))  # fmt: skip

    def plot(self) -> Any:
        """Draw the signal of each record over what was measured, and return matplotlib's figure."""
        records = [one for record in self.campaign.records for one in record.each]
        outputs = {o.name: o for o in self.model.plant.outputs}
        figure, cells = record_axes(len(records), 2.9)
        for (axis,), record in zip(cells, records, strict=True):
            output = outputs.get(record.output, self.model.plant.outputs[0])
            header, factor = si_header(output)
            columns = self.tables[record.file]
            axis.plot(record.times, record.measured, color="0.6", label="measured")
            axis.plot(columns["time_s"], columns[header] * factor, label="simulated")
            axis.set(title=record.file, xlabel="time [s]", ylabel=f"{output.name} [{record.unit}]")
        figure.legend(*cells[0][0].get_legend_handles_labels(), loc="lower center", ncols=2, frameon=False)
        return detached(figure)

    def save(self, folder: str | Path) -> list[str]:
        """Write a CSV file a record, all or none, and return their names.

        Raises DataError for the folder of the campaign, whose records would be lost.
        """
        if Path(folder).resolve() == self.campaign.folder.resolve():
            raise DataError(f"{quoted(str(folder))} is the folder of the campaign, whose records would be lost: "
                             "another one is expected")  # fmt: skip
        with NewFiles(Path(folder)) as files:
            for file, columns in self.tables.items():
                write_table(files.path(file), columns)
        return files.names


def candidate_of(model: Model, campaign: Campaign, given: Mapping[str, float]) -> Array:
    """Return the whole candidate: given values, then what the campaign fixes, then nominal and null values."""
    for name, value in given.items():
        if name not in model.parameters:
            raise ModelError(f"parameter '{name}' is not in the model: {nearest(name, model.parameters)}")
        if not isinstance(value, int | float | np.number) or not np.isfinite(value):
            raise ModelError(f"parameter '{name}': {value} was found, a finite number is expected")
    values = []
    for name, p in model.parameters.items():
        choices = (given.get(name), campaign.parameters.get(name, Override()).fixed, p.nominal, p.null, p.fixed)
        known = [v for v in choices if v is not None]
        if not known:
            raise ModelError(f"parameter '{name}' has no nominal value: a value is expected ({p.unit})")
        values.append(float(known[0]))
    return np.array(values)


def simulated_table(record: Record, model: Model, candidate: Array, accuracy: str | None) -> dict[str, Array]:
    parts = [simulated_piece(p, record, model, candidate, accuracy) for p in record.whole_pieces]
    columns = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    shown = columns["time_s"] > -1e-3 * record.manoeuvre.interval
    return {name: values[shown] for name, values in columns.items()}


def simulated_piece(
    piece: Piece, record: Record, model: Model, candidate: Array, accuracy: str | None
) -> dict[str, Array]:
    wanted = accuracy or accuracy_against(record.noises, model)
    calibration = calibrate(model, piece.manoeuvre, candidate[np.newaxis], wanted, spans=False)
    simulation = simulate(model, piece.manoeuvre, candidate[np.newaxis], calibration.schedule, states=True)
    if simulation.failed[0]:
        raise ModelError(f"record '{record.file}': the simulation diverges with these parameters")
    if not calibration.reached:
        off = f"the engine is off by up to {calibration.error:.2g} {model.plant.output_unit} even at its finest steps"
        warnings.warn(f"{record.file}: {off}: these parameters move too fast for them, or near a point from which "
                      "neighbours part", stacklevel=2)  # fmt: skip
    speed = model.plant.aliases.get("omega", "omega")
    columns = {"time_s": piece.manoeuvre.times()}
    pairs = zip(map(si_header, model.plant.outputs), simulation.outputs, strict=True)
    recorded = {header: y[0] / factor for (header, factor), y in pairs}
    for name, state in model.states.items():
        if name == speed and model.plant.records_one_speed:
            columns |= recorded
        elif state.column:
            columns[state.column] = simulation.states[name][0]
    columns |= recorded
    if speed in model.states and any("output" in e.adds for e in model.effects):
        columns[model.states[speed].column or f"{speed}_state"] = simulation.states[speed][0]
    return columns


def si_header(output: Output) -> tuple[str, float]:
    """Return the column of an output, in SI where there is one, and the factor that turns it into SI."""
    return min(output.factors.items(), key=lambda pair: pair[1] != 1.0)
