"""How far the noise of measured inputs moves the simulated signals.

A measured current or torque is not quite what drove the machine, and fits take it as exact. Where a noisy torque is
integrated to a speed, what a right model leaves looks like a random walk. This tells how large it is.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from armid.model import Array, Manoeuvre
from armid.problem.problem import Replay, by_record
from armid.record import Record
from armid.record.sensor import InputNoise

# Simulations of each record, and the seed of the errors.
DRAWS, SEED = 16, 1


def moved_by_inputs(replays: Sequence[Replay], candidate: Array) -> dict[str, float]:
    """Return how far noise of the inputs moves each output, from simulations with drawn errors.

    Parameters
    ----------
    replays : sequence of Replay
        Of records whose inputs may be measured with noise.
    candidate : array, (n_parameters,)
        Whole, SI.

    Returns
    -------
    dict
        Output -> rms [its unit]; empty where all inputs are commands.
    """
    noise = pooled_noise([ready.record for ready in by_record(replays)])
    if not noise:
        return {}
    rng, whole, squares = np.random.default_rng(SEED), candidate[np.newaxis], dict[str, list[Array]]()
    for ready, signals in by_record(replays).items():
        exact = ready.runs(whole)
        runs = [replace(ready, record=with_errors(ready.record, noise, rng)).runs(whole) for _ in range(DRAWS)]
        for r in signals:
            name = r.model.plant.outputs[r.place].name
            squares.setdefault(name, []).extend(np.ravel(r.seen(run) - r.seen(exact)) ** 2 for run in runs)
    return {name: float(np.sqrt(np.mean(np.concatenate(values)))) for name, values in squares.items()}


def pooled_noise(records: Sequence[Record]) -> dict[str, InputNoise]:
    """Return the noise of each measured input: the median over the records that show it, and their smallest step.

    A motion that passes few values shows multiples of the step.
    """
    seen: dict[str, list[InputNoise]] = {}
    for record in records:
        for name, noise in record.input_noise.items():
            seen.setdefault(name, []).append(noise)
    rms = {name: float(np.median([n.rms for n in noises])) for name, noises in seen.items()}
    steps = {name: min((n.step for n in noises if n.step), default=0.0) for name, noises in seen.items()}
    return {name: InputNoise(rms[name], steps[name]) for name in seen}


def with_errors(record: Record, noise: Mapping[str, InputNoise], rng: np.random.Generator) -> Record:
    """Return a record with drawn errors of its inputs; pieces do not share theirs."""

    def drawn(manoeuvre: Manoeuvre) -> Manoeuvre:
        errors = {name: n.drawn(manoeuvre.inputs[name], rng) for name, n in noise.items()}
        return replace(manoeuvre, inputs={name: values + errors.get(name, 0.0)
                                          for name, values in manoeuvre.inputs.items()})  # fmt: skip

    return record.with_pieces(lambda piece: replace(piece, manoeuvre=drawn(piece.manoeuvre)))
