"""Is there a discrepancy, and where: tests of a whitened residual against noise."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2 as chi2_distribution
from scipy.stats import f as f_distribution

from armid.engine import along, simulate
from armid.loop.candidates import Library
from armid.loop.fit import Fit
from armid.loop.whitening import Evidence, evidence_of, white_records
from armid.model import Model
from armid.problem.replay import Replay
from armid.record import Record

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


N_BINS = 12
# Products of columns whose share of the largest is below this are rounding.
DEPENDENT = 1e-11


def square_along(columns: Array, values: Array) -> tuple[float, int]:
    """Return the sum of squares of the part of some values along columns, and the rank of these.

    By the small matrix of their products: a decomposition of tall columns takes thirty times as long.
    """
    scaled = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    sizes, directions = np.linalg.eigh(scaled.T @ scaled)
    good = sizes > DEPENDENT * sizes[-1]
    along = directions[:, good].T @ (scaled.T @ values)
    return float(np.sum(along**2 / sizes[good])), int(good.sum())


def binned(values: Array) -> Array:
    """Return indicators of bins that hold about equally many samples, (n_samples, n_bins)."""
    edges = np.unique(np.quantile(values, np.linspace(0.0, 1.0, N_BINS + 1)))
    place = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, max(len(edges) - 2, 0))
    return indicators(place)


def stretched(edges: NDArray[np.int64]) -> Array:
    """Return indicators of twelve stretches of time of each record; edges: where the records begin, and the end."""
    parts = [np.arange(n) * N_BINS // max(n, 1) for n in np.diff(edges)]
    return indicators(np.concatenate([p + i * N_BINS for i, p in enumerate(parts)]))


def indicators(place: NDArray[np.int64]) -> Array:
    """Return a column for each value, 1 where it is taken."""
    return np.asarray(place[:, np.newaxis] == np.unique(place), dtype=np.float64)


# Chance of a false alarm, all tests together.
SIGNIFICANCE = 0.01
LAGS = 40
BANDS_HZ = (0.0, 5.0, 12.0, 25.0, 50.0, 100.0, 250.0, np.inf)
# Neighbouring ordinates of a tapered periodogram tell partly the same; a band needs so many of the rest.
INDEPENDENT, FEWEST_ORDINATES = 0.5, 4


@dataclass(frozen=True)
class Finding:
    """Hold one test: what it looked at, the mean square there in units of the noise's, and its chance from noise."""

    kind: str
    where: str
    ratio: float
    p: float


@dataclass(frozen=True)
class Diagnosis:
    """Hold all tests of a residual; significant when the least chance, times the number of tests, is below 1 %."""

    findings: tuple[Finding, ...]
    noise_known: bool

    @property
    def p(self) -> float:
        """Chance of the most striking finding from noise alone (Bonferroni)."""
        return min(1.0, len(self.findings) * min((f.p for f in self.findings), default=1.0))

    @property
    def significant(self) -> bool:
        """Whether what remains is more than noise."""
        return self.p < SIGNIFICANCE

    def of_kind(self, kind: str) -> list[Finding]:
        """Return the findings of one kind, most striking first."""
        return sorted((f for f in self.findings if f.kind == kind), key=lambda f: (f.p, -f.ratio))


def diagnose(view: View) -> Diagnosis:
    """Test a residual: its size, its correlation in time, on what it depends, and where it is."""
    tests = (size_tests, repeat_tests, time_tests, dependence_tests, band_tests)
    return Diagnosis(tuple(f for test in tests for f in test(view)), view.evidence.known)


def doubt(view: View) -> float:
    """Return the degrees of freedom from which the noise of slow signals is known.

    Infinite where it is not: then nothing is tested against it, but the residual against itself.
    """
    return float(min((level.n_slow for level in view.evidence.levels if level.known), default=np.inf))


def scale(view: View) -> float:
    """Return the variance that tests of structure divide by: 1 for known noise, else that of the residual itself."""
    return 1.0 if view.evidence.known else float(np.mean(view.residual**2))


def size_tests(view: View) -> Iterator[Finding]:
    """Compare mean squares with the noise: of all samples, of each record, before and after each switch.

    Of the residual as it is, not whitened: a filter that is known from a short rest is not trusted with its size.
    Either mean square counts as many samples as are independent for it.
    """
    if not view.evidence.known:
        return
    n = len(view.residual)
    everything = {"all records": np.ones(n, dtype=np.bool_)}
    edges, rows, files = view.evidence.edges, np.arange(n), [r.file for r in view.evidence.records]
    records = {f: (rows >= a) & (rows < b) for f, (a, b) in zip(files, pairwise(edges), strict=True)}
    levels, lengths = view.evidence.levels, np.diff(edges)
    square = np.repeat([level.rms**-2.0 for level in levels], lengths) * np.concatenate(view.raw) ** 2
    counted = np.repeat([level.n_power / level.n_samples for level in levels], lengths)
    known = min(level.n_power for level in levels)
    for kind, parts in (("size", everything), ("record", records), ("stage", view.stages)):
        if kind == "record" and len(parts) == 1:
            continue
        for where, samples in parts.items():
            share = 1.0 - view.basis.shape[1] / n
            ratio = float(np.mean(square[samples])) / share
            yield Finding(kind, where, ratio, float(f_distribution.sf(ratio, counted[samples].sum() * share, known)))


def repeat_tests(view: View) -> Iterator[Finding]:
    """Compare the mean of repeats with their scatter (pure-error lack of fit), which needs no other noise."""
    groups: dict[str, list[Array]] = {}
    for record, part in zip(view.evidence.records, view.evidence.by_record(view.residual), strict=True):
        groups.setdefault(record.repeat_of or record.file, []).append(part)
    for name, parts in groups.items():
        if len(parts) < 2 or len({len(p) for p in parts}) > 1:
            continue
        table = np.array(parts)
        mean = table.mean(axis=0)
        lack, pure = len(parts) * float(mean @ mean), float(np.sum((table - mean) ** 2))
        free, scatter = len(mean), (len(parts) - 1) * len(mean)
        ratio = (lack / free) / (pure / scatter)
        yield Finding("repeats", name, ratio, float(f_distribution.sf(ratio, free, scatter)))


def time_tests(view: View) -> Iterator[Finding]:
    """Test the autocorrelation of the residual (Ljung and Box, all records together).

    Only where the noise is white: what an imperfect filter leaves of coloured noise would be taken for a discrepancy;
    there the spectra of residual and rest are compared (`band_tests`).
    """
    from statsmodels.stats.diagnostic import acorr_ljungbox

    if not all(level.is_white for level in view.evidence.levels):
        return
    parts = view.evidence.by_record(view.residual)
    lags = min(LAGS, *(len(p) // 4 for p in parts))
    total = sum(float(acorr_ljungbox(p, lags=[lags])["lb_stat"].iloc[0]) for p in parts)
    ratio = total / (lags * len(parts))
    yield Finding("autocorrelation", f"{lags} lags", ratio, float(chi2_distribution.sf(total, lags * len(parts))))


def dependence_tests(view: View) -> Iterator[Finding]:
    """Regress the residual on bins of each variable of the motion, and on stretches of each record's time.

    The bins are filtered as the residual is, and projected off what the fit has absorbed.
    """
    for name, values in view.variables.items():
        if name != "time" and np.ptp(values) > 0.0:
            yield structure(view, "dependence", name, binned(values))
    yield structure(view, "dependence", "time in the record", stretched(view.evidence.edges))


def structure(view: View, kind: str, where: str, columns: Array) -> Finding:
    """Test a residual for a part along some columns (not yet whitened), (n_samples, n_columns)."""
    white = view.evidence.white(view.evidence.by_record(columns.T)).T
    along, rank = square_along(white - view.basis @ (view.basis.T @ white), view.residual)
    square = along / scale(view)
    if not view.evidence.known:
        # Neighbours tell the same: of the residual's own scatter only the independent samples count.
        square *= view.evidence.independent(view.residual) / len(view.residual)
    return Finding(kind, where, square / rank, float(f_distribution.sf(square / rank, rank, doubt(view))))


def band_tests(view: View) -> Iterator[Finding]:
    """Compare the power of the residual in bands of frequency with that of the rest, or with a flat one.

    White noise has a flat spectrum, whose level the rest tells; of coloured noise the rest itself shows the spectrum.
    """
    left, coloured = spectra(view.raw, view), not all(level.is_white for level in view.evidence.levels)
    rests = spectra([r.rest - np.mean(r.rest) for r in view.evidence.records], view) if coloured else {}
    for band, values in sorted(left.items()):
        other = rests.get(band, [])
        if coloured and len(other) < FEWEST_ORDINATES:
            continue
        against = float(np.mean(other)) if coloured else scale(view)
        ratio, free = float(np.mean(values)) / against, 2.0 * INDEPENDENT * len(values)
        known = 2.0 * INDEPENDENT * len(other) if coloured else doubt(view)
        high = BANDS_HZ[band + 1]
        where = f"{BANDS_HZ[band]:g} to {high:g} Hz" if np.isfinite(high) else f"above {BANDS_HZ[band]:g} Hz"
        yield Finding("frequency", where, ratio, float(f_distribution.sf(ratio, free, known)))


def spectra(signals: Sequence[Array], view: View) -> dict[int, list[float]]:
    """Return the ordinates of tapered periodograms of signals (one a record), band -> mean squares over the noise's."""
    found: dict[int, list[float]] = {}
    for record, level, signal in zip(view.evidence.records, view.evidence.levels, signals, strict=True):
        taper = np.hanning(len(signal) + 2)[1:-1]
        power = np.abs(np.fft.rfft(signal * taper)[1:-1]) ** 2 / float(taper @ taper) / level.rms**2
        frequency = np.fft.rfftfreq(len(signal), record.manoeuvre.interval)[1:-1]
        for band, value in zip(np.searchsorted(BANDS_HZ, frequency, side="right") - 1, power, strict=True):
            found.setdefault(int(band), []).append(float(value))
    return found
