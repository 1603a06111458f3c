"""What a fitted model leaves on some records: residual, and the motion that it belongs to."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from armid.discrepancy.evidence import Evidence, evidence_of, white_records
from armid.discrepancy.fit import Fit
from armid.discrepancy.library import Library
from armid.model import Model
from armid.problem import Replay
from armid.record import Record
from armid.simulation import along, simulate

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class View:
    """Hold records as one candidate sees them.

    candidate: whole, SI. residual: whitened, measured minus simulated, (n_samples,). basis: what the fit has absorbed,
    (n_samples, n_absorbed), with no columns on records that it has not seen.
    """

    evidence: Evidence
    replays: tuple[Replay, ...]
    candidate: Array
    residual: Array
    basis: Array

    @property
    def model(self) -> Model:
        """The model that was simulated."""
        return self.replays[0].model

    @cached_property
    def raw(self) -> list[Array]:
        """Measured minus simulated of each record [its unit], not whitened."""
        return [r.measured - r.signal(self.candidate[np.newaxis])[0] for r in self.replays]

    @cached_property
    def variables(self) -> dict[str, Array]:
        """Variables of the simulated motion at all samples, name -> (n_samples,): states that files show, inputs,
        command and drive; `time` is the time in the record [s].
        """
        names = variable_names(self.model)
        parts: dict[str, list[Array]] = {n: [] for n in names}
        for replay in self.replays:
            for piece, calibration in zip(replay.pieces, replay.calibrations, strict=True):
                found = along(self.model, piece.manoeuvre, self.candidate, calibration.schedule, names)
                for n in names:
                    parts[n].append(found[n][piece.window])
        times = np.concatenate([r.times for r in self.replays])
        return {n: np.concatenate(p) for n, p in parts.items()} | {"time": times}

    @cached_property
    def stages(self) -> dict[str, NDArray[np.bool_]]:
        """Samples before and after each one-way switch of the plant, name -> (n_samples,); empty without a switch."""
        found: dict[str, NDArray[np.bool_]] = {}
        for name in (g.name for g in self.model.plant.guards if g.latch):
            after = np.concatenate([switched(r, self.candidate, name) for r in self.replays])
            found |= {f"before '{name}'": ~after, f"after '{name}'": after}
        return {n: samples for n, samples in found.items() if samples.any()}


def switched(replay: Replay, candidate: Array, latch: str) -> NDArray[np.bool_]:
    """Return which samples of a record come after a one-way switch."""
    parts = []
    for piece, calibration in zip(replay.pieces, replay.calibrations, strict=True):
        run = simulate(replay.model, piece.manoeuvre, candidate[np.newaxis], calibration.schedule)
        times = piece.manoeuvre.times()[piece.window]
        parts.append(times >= run.switch_times[latch][0])
    return np.concatenate(parts)


def variable_names(model: Model) -> list[str]:
    """Return the variables on which a residual may depend."""
    plant = model.plant
    names = [s.name for s in plant.states if s.column] + [i.name for i in plant.inputs]
    return names + [n for n in ("voltage", "drive_effort") if n in plant.quantities]


def train_view(fit: Fit) -> View:
    """Return the records that a fit has seen."""
    return View(fit.records.evidence, fit.records.replays, fit.candidate, fit.residual, fit.basis)


def holdout_view(fit: Fit, records: tuple[Record, ...], library: Library) -> View | None:
    """Return records that no fit has seen, None where there are none."""
    if not records:
        return None
    problem = fit.records
    evidence = evidence_of(records, library.declared.plant, library.evidence.records)
    ready = library.replays(records, problem.replays[0].model, problem.space, fit.values)
    residual, slopes = white_records(ready, problem.space, evidence).residual_and_slopes(fit.z)
    return View(evidence, ready, fit.candidate, less_uncertain(fit, -residual, slopes), np.empty((len(residual), 0)))


def less_uncertain(fit: Fit, residual: Array, slopes: Array) -> Array:
    """Return a residual of records that a fit has not seen, divided by noise and doubt of the prediction together.

    The prediction scatters by U U^T with U = slopes x root of the covariance of the estimate: r -> (1 + U U^T)^-1/2 r.
    """
    _, values, right = np.linalg.svd(fit.jacobian, full_matrices=False)
    good = values > 1e-7 * values.max(initial=0.0)
    moved = slopes @ (right[good].T / values[good])
    base, sizes, _ = np.linalg.svd(moved, full_matrices=False)
    return np.asarray(residual - base @ ((1.0 - 1.0 / np.sqrt(1.0 + sizes**2)) * (base.T @ residual)))
