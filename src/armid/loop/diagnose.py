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
from armid.loop.candidates import Library, calibrated_replays
from armid.loop.fit import Fit, beyond
from armid.loop.whitening import WhitenedData, WhiteRecords, whitened
from armid.model import Model
from armid.problem.problem import Replay
from armid.record import Record

Array = NDArray[np.float64]
# Chance of a false alarm, all tests together.
SIGNIFICANCE = 0.01
LAGS, N_BINS = 40, 12
BANDS_HZ = (0.0, 5.0, 12.0, 25.0, 50.0, 100.0, 250.0, np.inf)
# Neighbouring ordinates of a tapered periodogram tell partly the same; a band needs so many of the rest.
INDEPENDENT, FEWEST_ORDINATES = 0.5, 4
# Products of columns whose share of the largest is below this are rounding.
DEPENDENT = 1e-11


@dataclass(frozen=True, eq=False)
class Residuals:
    """Hold records as one candidate sees them.

    candidate: whole, SI. residual: whitened, measured minus simulated, (n_samples,). basis: what the fit has absorbed,
    (n_samples, n_absorbed), with no columns on records that it has not seen.
    """

    data: WhitenedData
    replays: tuple[Replay, ...]
    candidate: Array
    residual: Array
    basis: Array

    @property
    def model(self) -> Model:
        return self.replays[0].model

    @property
    def variance(self) -> float:
        """What tests of structure divide by: 1 for known noise, else the mean square of the residual itself."""
        return 1.0 if self.data.known else float(np.mean(self.residual**2))

    @cached_property
    def raw(self) -> list[Array]:
        return [r.measured - r.signal(self.candidate[np.newaxis])[0] for r in self.replays]

    @cached_property
    def variables(self) -> dict[str, Array]:
        """Variables of the simulated motion at all samples, name -> (n_samples,): see `variable_names`."""
        names = variable_names(self.model)
        parts: dict[str, list[Array]] = {n: [] for n in names}
        for replay in self.replays:
            for piece, calibration in zip(replay.pieces, replay.calibrations, strict=True):
                found = along(self.model, piece.manoeuvre, self.candidate, calibration.schedule, names)
                for n in names:
                    parts[n].append(found[n][piece.window])
        return {n: np.concatenate(p) for n, p in parts.items()}

    @cached_property
    def stages(self) -> dict[str, NDArray[np.bool_]]:
        """Samples before and after each one-way switch of the plant, name -> (n_samples,); empty without a switch."""
        found: dict[str, NDArray[np.bool_]] = {}
        for name in (g.name for g in self.model.plant.guards if g.latch):
            parts = []
            for replay in self.replays:
                for piece, calibration in zip(replay.pieces, replay.calibrations, strict=True):
                    run = simulate(self.model, piece.manoeuvre, self.candidate[np.newaxis], calibration.schedule)
                    parts.append(piece.manoeuvre.times()[piece.window] >= run.switch_times[name][0])
            after = np.concatenate(parts)
            found |= {f"before '{name}'": ~after, f"after '{name}'": after}
        return {n: samples for n, samples in found.items() if samples.any()}


def variable_names(model: Model) -> list[str]:
    """Return the variables on which a residual may depend.

    Speed and position, the other states that files show, inputs, the plant's voltage and the effort of its drive.
    """
    plant = model.plant
    states = [s.name for s in plant.states if s.column] or [s.name for s in plant.states]
    first = [n for n in (plant.aliases.get(a, a) for a in ("omega", "theta")) if n in states]
    drive = [n for n in ("voltage", "drive_effort") if n in plant.quantities]
    return [*first, *(n for n in states if n not in first), *(i.name for i in plant.inputs), *drive]


def train_residuals(fit: Fit) -> Residuals:
    return Residuals(fit.records.data, fit.records.replays, fit.candidate, fit.residual, fit.basis)


def holdout_residuals(fit: Fit, records: tuple[Record, ...], library: Library) -> Residuals | None:
    """Return what a fit leaves on records that it has not seen, None where there are none.

    Divided by noise and doubt of the prediction together: the prediction scatters by U U^T with U = slopes x root of
    the covariance of the estimate, so that r -> (1 + U U^T)^-1/2 r.
    """
    if not records:
        return None
    data = whitened(records, library.declared.plant, library.data.records)
    ready = calibrated_replays(records, fit.model, fit.records.space, fit.values)
    residual, slopes = WhiteRecords(ready, fit.records.space, data).residual_and_slopes(fit.z)
    _, values, right = np.linalg.svd(fit.jacobian, full_matrices=False)
    good = values > 1e-7 * values.max(initial=0.0)
    base, sizes, _ = np.linalg.svd(slopes @ (right[good].T / values[good]), full_matrices=False)
    left = residual - base @ ((1.0 - 1.0 / np.sqrt(1.0 + sizes**2)) * (base.T @ residual))
    return Residuals(data, ready, fit.candidate, np.asarray(left), np.empty((len(residual), 0)))


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


def diagnose(seen: Residuals) -> Diagnosis:
    """Test a residual: its size, its correlation in time, on what it depends, and where it is."""
    tests = (size_tests, repeat_tests, time_tests, dependence_tests, band_tests)
    return Diagnosis(tuple(f for test in tests for f in test(seen)), seen.data.known)


def size_tests(seen: Residuals) -> Iterator[Finding]:
    """Compare mean squares with the noise: of all samples, of each record, before and after each switch.

    Of the residual as it is, not whitened: a filter that is known from a short rest is not trusted with its size.
    Either mean square counts as many samples as are independent for it.
    """
    if not seen.data.known:
        return
    n, edges, levels = len(seen.residual), seen.data.edges, seen.data.levels
    rows, lengths = np.arange(n), np.diff(edges)
    records = {r.file: (rows >= a) & (rows < b) for r, (a, b) in zip(seen.data.records, pairwise(edges), strict=True)}
    square = np.repeat([level.rms**-2.0 for level in levels], lengths) * np.concatenate(seen.raw) ** 2
    counted = np.repeat([level.n_power / level.n_samples for level in levels], lengths)
    known, share = min(level.n_power for level in levels), 1.0 - seen.basis.shape[1] / n
    whole = {"all records": np.ones(n, dtype=np.bool_)}
    for kind, parts in (("size", whole), ("record", records if len(records) > 1 else {}), ("stage", seen.stages)):
        for where, samples in parts.items():
            ratio = float(np.mean(square[samples])) / share
            yield Finding(kind, where, ratio, float(f_distribution.sf(ratio, counted[samples].sum() * share, known)))


def repeat_tests(seen: Residuals) -> Iterator[Finding]:
    """Compare the mean of repeats with their scatter (pure-error lack of fit), which needs no other noise."""
    groups: dict[str, list[Array]] = {}
    for record, part in zip(seen.data.records, seen.data.by_record(seen.residual), strict=True):
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


def time_tests(seen: Residuals) -> Iterator[Finding]:
    """Test the autocorrelation of the residual (Ljung and Box, all records together).

    Only where the noise is white: what an imperfect filter leaves of coloured noise would be taken for a discrepancy;
    there the spectra of residual and rest are compared (`band_tests`).
    """
    from statsmodels.stats.diagnostic import acorr_ljungbox

    if not all(level.is_white for level in seen.data.levels):
        return
    parts = seen.data.by_record(seen.residual)
    lags = min(LAGS, *(len(p) // 4 for p in parts))
    total = sum(float(acorr_ljungbox(p, lags=[lags])["lb_stat"].iloc[0]) for p in parts)
    ratio = total / (lags * len(parts))
    yield Finding("autocorrelation", f"{lags} lags", ratio, float(chi2_distribution.sf(total, lags * len(parts))))


def dependence_tests(seen: Residuals) -> Iterator[Finding]:
    """Regress the residual on bins of each variable of the motion, and on twelve parts of each record's time.

    The bins hold about equally many samples; they are filtered as the residual is, and projected off what the fit has
    absorbed.
    """
    for name, values in seen.variables.items():
        if np.ptp(values) > 0.0:
            edges = np.unique(np.quantile(values, np.linspace(0.0, 1.0, N_BINS + 1)))
            place = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, max(len(edges) - 2, 0))
            yield structure(seen, "dependence", name, place)
    parts = [np.arange(n) * N_BINS // max(n, 1) for n in np.diff(seen.data.edges)]
    places = np.concatenate([p + i * N_BINS for i, p in enumerate(parts)])
    yield structure(seen, "dependence", "time in the record", places)


def structure(seen: Residuals, kind: str, where: str, place: NDArray[np.int64]) -> Finding:
    """Test a residual for a part that is constant in each bin; place: the bin of each sample, (n_samples,)."""
    indicators = np.asarray(place[:, np.newaxis] == np.unique(place), dtype=np.float64)
    white = seen.data.white(seen.data.by_record(indicators.T)).T
    along, rank = square_along(beyond(seen.basis, white), seen.residual)
    square = along / seen.variance
    if not seen.data.known:
        # Neighbours tell the same: of the residual's own scatter only the independent samples count.
        square *= seen.data.independent(seen.residual) / len(seen.residual)
    known = seen.data.n_noise(otherwise=np.inf)
    return Finding(kind, where, square / rank, float(f_distribution.sf(square / rank, rank, known)))


def square_along(columns: Array, values: Array) -> tuple[float, int]:
    """Return the sum of squares of the part of some values along columns, and the rank of these.

    By the small matrix of their products: a decomposition of tall columns takes thirty times as long.
    """
    scaled = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    sizes, directions = np.linalg.eigh(scaled.T @ scaled)
    good = sizes > DEPENDENT * sizes[-1]
    along = directions[:, good].T @ (scaled.T @ values)
    return float(np.sum(along**2 / sizes[good])), int(good.sum())


def band_tests(seen: Residuals) -> Iterator[Finding]:
    """Compare the power of the residual in bands of frequency with that of the rest, or with a flat one.

    White noise has a flat spectrum, whose level the rest tells; of coloured noise the rest itself shows the spectrum.
    """
    left, coloured = spectra(seen.raw, seen), not all(level.is_white for level in seen.data.levels)
    rests = spectra([r.rest - np.mean(r.rest) for r in seen.data.records], seen) if coloured else {}
    for band, values in sorted(left.items()):
        other = rests.get(band, [])
        if coloured and len(other) < FEWEST_ORDINATES:
            continue
        against = float(np.mean(other)) if coloured else seen.variance
        ratio, free = float(np.mean(values)) / against, 2.0 * INDEPENDENT * len(values)
        known = 2.0 * INDEPENDENT * len(other) if coloured else seen.data.n_noise(otherwise=np.inf)
        high = BANDS_HZ[band + 1]
        where = f"{BANDS_HZ[band]:g} to {high:g} Hz" if np.isfinite(high) else f"above {BANDS_HZ[band]:g} Hz"
        yield Finding("frequency", where, ratio, float(f_distribution.sf(ratio, free, known)))


def spectra(signals: Sequence[Array], seen: Residuals) -> dict[int, list[float]]:
    """Return the ordinates of tapered periodograms of signals (one a record), band -> mean squares over the noise's."""
    found: dict[int, list[float]] = {}
    for record, level, signal in zip(seen.data.records, seen.data.levels, signals, strict=True):
        taper = np.hanning(len(signal) + 2)[1:-1]
        power = np.abs(np.fft.rfft(signal * taper)[1:-1]) ** 2 / float(taper @ taper) / level.rms**2
        frequency = np.fft.rfftfreq(len(signal), record.manoeuvre.interval)[1:-1]
        for band, value in zip(np.searchsorted(BANDS_HZ, frequency, side="right") - 1, power, strict=True):
            found.setdefault(int(band), []).append(float(value))
    return found
