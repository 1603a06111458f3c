"""Is there a discrepancy, and where: tests of a whitened residual against noise."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import chain, pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc, fdtrc

from armid.engine import along
from armid.estimation.constants import columns_of, moved_record, slopes_of_constants
from armid.estimation.identify import JointErrors, campaign_errors
from armid.estimation.information import start_changes
from armid.estimation.input_noise import estimated, pooled_noise
from armid.estimation.noise_model import NoiseModel
from armid.inference.decisions import SIGNIFICANCE
from armid.inference.library import Library, calibrated_replays
from armid.inference.model import Fit, beyond, decomposed
from armid.inference.whitening import WhitenedData, WhiteRecords, whitened, with_answers
from armid.model import Array, Model
from armid.model.effects.sensor import average_error
from armid.problem.cover import Cover
from armid.problem.problem import Replay, with_each
from armid.problem.starts import with_starts
from armid.record import Record
from armid.record.sensor import Sensor, memory_of

LAGS, N_BINS = 40, 12
BANDS_HZ = (0.0, 5.0, 12.0, 25.0, 50.0, 100.0, 250.0, np.inf)
# Neighbouring ordinates of a tapered periodogram tell partly the same; a band needs so many of the rest.
INDEPENDENT, FEWEST_ORDINATES = 0.5, 4
# Frequencies of mains and number of their harmonics. A line is compared with so many frequencies to either side, which
# are NEXT_TO_LINE widths 1/T of the rest apart.
MAINS_HZ, HARMONICS, BESIDE_LINE, NEXT_TO_LINE = (50.0, 60.0), 5, 3, 3.0
# So small a p-value stays significant whatever the number of tests.
CERTAIN = 1e-7
# Products of columns whose share of the largest is below this are rounding.
DEPENDENT = 1e-11
# Share of the samples of a record over which lines are drawn where they are no data.
MOST_BRIDGED = 0.05
# Draws of the noise of sensors that round.
N_ROUNDED = 8
# Below this share of the largest speed a machine is at rest; below this share of the largest change its speed is even.
STILL, EVEN_SPEED = 0.02, 0.1


@dataclass(frozen=True, eq=False)
class Residuals:
    """Hold records as one candidate sees them.

    candidate: whole, SI. residual: whitened, measured minus simulated, (n_samples,). basis: what the fit has absorbed,
    (n_samples, n_absorbed), with no columns on records that it has not seen. doubted: whether the residual, and not the
    raw one, tells of size: it is divided by the doubt of a prediction, which tolerances of constants and measured
    starts make large. fitted: those of the train records, where these are held out.
    """

    data: WhitenedData
    replays: tuple[Replay, ...]
    candidate: Array
    residual: Array
    basis: Array
    doubted: bool = False
    fitted: "Residuals | None" = None

    @property
    def model(self) -> Model:
        return self.replays[0].model

    @cached_property
    def errors(self) -> JointErrors:
        return campaign_errors(self.judged, self.candidate)

    @cached_property
    def diagnosis(self) -> "Diagnosis":
        """Tests of size, time, dependence and frequency; a simulation that diverges fails without them."""
        if not np.isfinite(self.residual).all():
            return Diagnosis((Finding("size", "all records", np.inf, 0.0),), self.data.known)
        tests = (size_tests, repeat_tests, time_tests, dependence_tests, band_tests)
        return Diagnosis(tuple(f for test in tests for f in test(self)), self.data.known)

    @property
    def noise_rms(self) -> float:
        """Noise of the sensor of the first output, all samples together [its unit]."""
        return next(iter(self.pooled([level.rms for level in self.data.levels]).values()))

    @property
    def noise_of(self) -> dict[str, float]:
        """What noise leaves of each output that is recorded, by its name [its unit]."""
        return self.pooled([level.total for level in self.data.levels])

    def pooled(self, sizes: Sequence[float]) -> dict[str, float]:
        """Return the rms of each output that is recorded, all samples together; sizes: rms of each signal."""
        pooled: dict[str, float] = {}
        for place in sorted({r.place for r in self.replays}):
            of = [(size, len(r.measured)) for size, r in zip(sizes, self.replays, strict=True) if r.place == place]
            square = sum(size**2 * n for size, n in of) / sum(n for _, n in of)
            pooled[self.model.plant.outputs[place].name] = float(np.sqrt(square))
        return pooled

    @cached_property
    def memory(self) -> dict[int, float]:
        """Correlation of neighbouring samples of the noise, by place of the output; 0 where rests tell the noise.

        Elsewhere the residual itself tells it, see `memory_of`: that of the train records, which are more.
        """
        if self.fitted is not None:
            return self.fitted.memory
        parts, places = self.data.by_record(self.residual), [r.place for r in self.replays]
        if self.data.known or self.data.rests_have_colour:
            return dict.fromkeys(places, 0.0)
        return {p: memory_of([x for x, of in zip(parts, places, strict=True) if of == p]) for p in places}

    @cached_property
    def renewed(self) -> list[Array]:
        """What each sample of the residual adds to its neighbour, by record: e_t - rho e_(t-1)."""
        return self.without_memory(self.residual)

    def without_memory(self, white: Array) -> list[Array]:
        pairs = [(x, self.memory.get(r.place, 0.0)) for x, r in
                 zip(self.data.by_record(white), self.replays, strict=True)]  # fmt: skip
        return [x if rho == 0.0 else np.append(x[:1], x[1:] - rho * x[:-1]) for x, rho in pairs]

    @cached_property
    def rounded(self) -> Array:
        """What sensors that round leave of the simulated motion, whitened, in draws of their noise, (n, n_samples).

        A slow motion passes their steps in a saw tooth, and where it stands their error stays: such noise has a colour
        that changes with the motion. Empty where no sensor rounds, or where its noise has a colour of its own.
        """
        levels, sensors = self.data.levels, [r.record.signals[0].sensor for r in self.replays]
        is_white = all(not (len(level.terms) or level.growth) for level in levels)
        if not is_white or not any(s.step for s in sensors):
            return np.empty((0, len(self.residual)))
        rng = np.random.default_rng(0)
        fine = [own_noise(level, sensor, raw, y) for level, sensor, raw, y
                in zip(levels, sensors, self.raw, self.simulated, strict=True)]  # fmt: skip
        counted = [
            self.window(r) or int(level.alternation > 0.0) for r, level in zip(self.replays, levels, strict=True)
        ]
        draws = []
        for _ in range(N_ROUNDED):
            errors = [sensor.counting_error(y, rng.random(), over) if over and sensor.step else
                      rounding_error(sensor, float(r.measured[0]), y, size, rng)
                      for r, over, sensor, y, size
                      in zip(self.replays, counted, sensors, self.simulated, fine, strict=True)]  # fmt: skip
            draws.append(self.data.white(errors))
        return np.array(draws)

    def window(self, replay: Replay) -> int:
        """Return over how many samples the model holds an output to be the mean, 0 where it does not."""
        port = self.model.plant.outputs[replay.place].port
        values = dict(zip(self.model.parameters, self.candidate, strict=True))
        means = [e for e in self.model.effects if e.adds.get(port) is average_error]
        return round(values[f"{means[0].name}.window"] / replay.record.spacing) if means else 0

    @cached_property
    def raw(self) -> list[Array]:
        """What is left of each record, not whitened, 0 where a sample is invalid; see `Replay.zeroed`."""
        triples = zip(self.judged, self.simulated, self.data.by_record(self.data.sound), strict=True)
        return [(r.zeroed(simulated) - simulated) * sound for r, simulated, sound in triples]

    @cached_property
    def simulated(self) -> list[Array]:
        return [r.signal(self.candidate[np.newaxis])[0] for r in self.replays]

    @cached_property
    def judged(self) -> tuple[Replay, ...]:
        """The replays whose errors count: invalid samples are replaced by simulated ones."""
        triples = zip(self.replays, self.simulated, self.data.by_record(self.data.sound), strict=True)
        return tuple(r if sound.all() else r.measuring(np.where(sound > 0.0, r.measured, simulated))
                     for r, simulated, sound in triples)  # fmt: skip

    @cached_property
    def variables(self) -> dict[str, Array]:
        """Variables of the simulated motion at all samples, name -> (n_samples,): see `variable_names`."""
        names = variable_names(self.model)
        parts: dict[str, list[Array]] = {n: [] for n in names}
        for replay in self.replays:
            own = replay.ready.own(self.candidate)
            triples = zip(replay.pieces, replay.calibrations, replay.record.samples, strict=True)
            for piece, calibration, samples in triples:
                motion = along(self.model, piece.manoeuvre, own, calibration.schedule, names)
                for n in names:
                    parts[n].append(motion[n][samples])
        return {n: np.concatenate(p) for n, p in parts.items()}

    @cached_property
    def stages(self) -> dict[str, NDArray[np.bool_]]:
        """Samples before and after each one-way switch of the plant, name -> (n_samples,); empty without a switch."""
        stages: dict[str, NDArray[np.bool_]] = {}
        for name in (g.name for g in self.model.plant.guards if g.latch):
            runs = (zip(r.pieces, r.record.samples, r.ready.runs(self.candidate[np.newaxis]), strict=True)
                    for r in self.replays)  # fmt: skip
            after = np.concatenate([piece.manoeuvre.times()[samples] >= run.switch_times[name][0]
                                    for piece, samples, run in chain.from_iterable(runs)])  # fmt: skip
            stages |= {f"before '{name}'": ~after, f"after '{name}'": after}
        return {n: samples for n, samples in stages.items() if samples.any()}

    @cached_property
    def phases(self) -> dict[str, NDArray[np.bool_]]:
        """Samples by what the simulated motion does, in words -> (n_samples,); empty where no state is a speed."""
        speed = self.variables.get(self.model.plant.aliases.get("omega", "omega"))
        return {} if speed is None else motion_phases([np.abs(v) for v in self.data.by_record(speed)])


def motion_phases(speeds: Sequence[Array]) -> dict[str, NDArray[np.bool_]]:
    """Return the samples of records at rest, speeding up, slowing down and at an even speed, in words -> (n_samples,).

    speeds: of each record, without sign, (n_samples,).
    """
    speed, change = np.concatenate(speeds), np.concatenate([np.gradient(v) for v in speeds])
    still = speed <= STILL * speed.max()
    even = ~still & (np.abs(change) <= EVEN_SPEED * np.abs(change).max())
    return {"at rest": still, "at an even speed": even, "while it speeds up": ~still & ~even & (change > 0.0),
            "while it slows down": ~still & ~even & (change < 0.0)}  # fmt: skip


def time_in_words(seen: Residuals) -> str:
    """Say when, in words of the motion, most of a residual is more than noise; "" where no state is a speed."""
    excess = np.maximum(seen.residual**2 - float(seen.data.known), 0.0)
    stages = seen.stages or {"": np.ones(len(excess), dtype=np.bool_)}
    masks = {", ".join(filter(None, (phase, stage))): a & b
             for phase, a in seen.phases.items() for stage, b in stages.items()}  # fmt: skip
    if not masks:
        return ""
    words = max(masks, key=lambda name: float(excess[masks[name]].sum()))
    share, time = float(excess[masks[words]].sum() / excess.sum()), float(np.mean(masks[words]))
    return f"When it is: {share:.0%} of it {words}, in {time:.0%} of the samples."


def variable_names(model: Model) -> list[str]:
    """Return the variables on which a residual may depend.

    Speed and position, the other states that files show, inputs, the plant's voltage and the effort of its drive.
    """
    plant = model.plant
    states = [s.name for s in plant.states if s.column] or [s.name for s in plant.states]
    first = [n for n in (plant.aliases.get(a, a) for a in ("omega", "theta")) if n in states]
    drive = [n for n in ("voltage", "drive_effort") if n in plant.quantities]
    return [*first, *(n for n in states if n not in first), *(i.name for i in plant.inputs), *drive]


def own_noise(level: NoiseModel, sensor: Sensor, raw: Array, motion: Array) -> float:
    """Return the rms of the noise of a sensor before it rounds [unit of the output].

    raw: what is left of a record. Where no rest tells the noise what changes from sample to sample does: the slow part
    of a rounding error hangs on the motion to less than a step, which no fit knows.
    """
    if level.known:
        return float(np.sqrt(max(level.rms**2 - sensor.rounding**2, 0.0)))
    return float(np.sqrt(max(quick_square(raw) - quick_square(sensor.reading(motion, 0.0) - motion), 0.0)))


def rounding_error(sensor: Sensor, known: float, motion: Array, noise: float, rng: np.random.Generator) -> Array:
    """Return what a sensor with some noise of its own rounds away of a motion, (n_samples,).

    known: one of its readings. A motion that left its start is known to less than a step, no better.
    """
    if not sensor.step:
        return noise * rng.standard_normal(len(motion))
    left = np.minimum(np.abs(motion - motion[0]) / sensor.step, 1.0)
    likely = motion + sensor.step * (rng.random() - 0.5) * left
    return np.asarray(sensor.reading(likely + noise * rng.standard_normal(len(motion)), known) - likely)


def quick_square(signal: Array) -> float:
    """Return the mean square of white noise that changes as much from sample to sample as a signal does."""
    return float(np.mean((signal[1:-1] - 0.5 * (signal[2:] + signal[:-2])) ** 2)) / 1.5


@lru_cache(maxsize=16)  # many ask about the same few models; what their tests share is found once
def train_residuals(fit: Fit) -> Residuals:
    """Return what a fit leaves on its records, beyond the reach of their measured starts: these are known roughly."""
    residual, basis = fit.residual, fit.basis
    if fit.start_slopes.shape[1]:
        basis = decomposed(np.hstack([fit.jacobian, fit.start_slopes]))[0]
        residual = beyond(basis, residual)
    residual = residual + assumed_noise(fit.records.data)
    return Residuals(fit.records.data, fit.records.replays, fit.candidate, residual, basis)


def assumed_noise(data: WhitenedData) -> Array:
    """Return noise for the signals for which it is assumed, 0 for all others, (n_samples,).

    What a right model leaves of a simulated motion is the error of its simulation, which has a colour.
    """
    rng, lengths = np.random.default_rng(0), np.diff(data.edges)
    return np.concatenate([rng.standard_normal(n) if level.assumed else np.zeros(n)
                           for level, n in zip(data.levels, lengths, strict=True)])  # fmt: skip


def is_significant(fit: Fit) -> bool:
    """Tell whether what a model leaves on train is more than noise; where its size alone says so, that is enough."""
    seen = train_residuals(fit)
    finding = next(size_tests(seen), None)
    return (finding is not None and finding.p < CERTAIN) or seen.diagnosis.significant


def holdout_residuals(fit: Fit, records: tuple[Record, ...], library: Library) -> Residuals | None:
    """Return what a fit leaves on records that it has not seen, None where there are none.

    Divided by noise and doubt of the prediction together: the prediction scatters by U U^T with U = slopes x root of
    the covariance of the estimate, so that r -> (1 + U U^T)^-1/2 r. Constants within tolerances are unknowns as the
    parameters are, with their tolerance as prior. The doubt of a measured start counts, too.
    """
    if not records:
        return None
    plant, tolerances = library.declared.plant, library.tolerances
    records = tuple(moved_record(r, plant, fit.constants) for r in records)
    data = whitened(records, plant, library.data if library.as_read is None else library.as_read)
    ready = with_starts(calibrated_replays(records, fit.model, fit.records.space, fit.values), fit.candidate)
    if library.as_read is not None:
        noise = pooled_noise(library.as_read.records)
        data = with_answers(data, ready, fit.candidate, noise)
        ready = with_each(ready, lambda one: replace(one, record=estimated(one.record, noise)))
    problem = WhiteRecords(ready, fit.records.space, data)
    residual, slopes = problem.residual_and_slopes(fit.z)
    within = fit.products(tolerances)
    known = columns_of(within, len(fit.residual))
    unseen = slopes_of_constants(problem, fit.z, [p.names[0] for p in within]).T * [p.tolerance for p in within]
    prior = np.hstack([np.zeros((len(within), fit.n_free)), np.eye(len(within))])
    _, values, right = np.linalg.svd(np.vstack([np.hstack([fit.jacobian, known]), prior]), full_matrices=False)
    good = values > 1e-7 * values.max(initial=0.0)
    spread = np.hstack([slopes, unseen.reshape(len(residual), len(within))]) @ (right[good].T / values[good])
    starts = list(start_changes(problem, fit.z, bent=True))
    spread = np.column_stack([spread, *starts])
    # A simulation that diverges there is not held to any doubt.
    spread = spread[:, np.isfinite(residual).all() & np.isfinite(spread).all(axis=0)]
    left = Cover.of(spread).white(residual) + assumed_noise(data)
    return Residuals(data, ready, fit.candidate, np.asarray(left), np.empty((len(residual), 0)),
                     bool(within or starts), train_residuals(fit))  # fmt: skip


@dataclass(frozen=True)
class Finding:
    """Hold one test: what it looked at, the mean square there in units of the noise's, and its chance from noise."""

    kind: str
    where: str
    ratio: float
    p: float


@dataclass(frozen=True)
class Diagnosis:
    """Hold all tests of a residual; significant when the least chance, times their number, is below `SIGNIFICANCE`."""

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


def chance(ratio: float, free: float, known: float) -> float:
    """Return the chance that noise shows a ratio of mean squares; known: samples that tell it, inf of a known one."""
    return float(fdtrc(free, known, ratio) if np.isfinite(known) else chdtrc(free, ratio * free))


def size_tests(seen: Residuals) -> Iterator[Finding]:
    """Compare mean squares with the noise: of all samples, of each record, before and after each switch.

    Of the residual as it is, not whitened: a filter that is known from a short rest is not trusted with its size. Where
    noise is correlated in blocks, nothing but the whitened one has a size.
    Either mean square counts as many samples as are independent for it.
    """
    if not seen.data.known:
        return
    n, edges, levels = len(seen.residual), seen.data.edges, seen.data.levels
    rows, lengths = np.arange(n), np.diff(edges)
    records = {r.name: (rows >= a) & (rows < b) for r, (a, b) in zip(seen.replays, pairwise(edges), strict=True)}
    square = np.repeat([level.rms**-2.0 for level in levels], lengths) * np.concatenate(seen.raw) ** 2
    square = seen.residual**2 if seen.doubted or seen.data.blocks else square
    counted = np.repeat([level.n_power / level.n_samples for level in levels], lengths)
    known, share = min(level.n_power for level in levels), 1.0 - seen.basis.shape[1] / n
    whole = {"all records": np.ones(n, dtype=np.bool_)}
    for kind in ("size", "record", "stage"):
        parts = {"size": whole, "record": records if len(records) > 1 else {}}.get(kind)
        for where, samples in (seen.stages if parts is None else parts).items():
            ratio = float(np.sum(square[samples])) / max(float(np.count_nonzero(seen.data.sound[samples])), 1.0) / share
            yield Finding(kind, where, ratio, float(fdtrc(counted[samples].sum() * share, known, ratio)))


def repeat_tests(seen: Residuals) -> Iterator[Finding]:
    """Compare the mean of repeats with their scatter (pure-error lack of fit), which needs no other noise."""
    groups: dict[tuple[str, str], list[Array]] = {}
    for record, part in zip(seen.data.each, seen.data.by_record(seen.residual), strict=True):
        groups.setdefault((record.manoeuvre_file, record.output), []).append(part)
    for (name, _), parts in groups.items():
        if len(parts) < 2 or len({len(p) for p in parts}) > 1:
            continue
        table = np.array(parts)
        mean = table.mean(axis=0)
        lack, pure = len(parts) * float(mean @ mean), float(np.sum((table - mean) ** 2))
        if pure == 0.0:  # a record and its copy
            continue
        free, scatter = len(mean), (len(parts) - 1) * len(mean)
        ratio = (lack / free) / (pure / scatter)
        yield Finding("repeats", name, ratio, float(fdtrc(free, scatter, ratio)))


def time_tests(seen: Residuals) -> Iterator[Finding]:
    """Test the autocorrelation of the residual, all records together (Ljung, Box 1978, doi:10.1093/biomet/65.2.297).

    Only where the noise is white: what an imperfect filter leaves of coloured noise, or of that of the inputs, would be
    taken for a discrepancy; there spectra are compared (`band_tests`). Hum that the rests show is taken out before.
    """
    if seen.data.rests_have_colour or seen.data.inputs_count:
        return
    parts, hum = seen.renewed, [sum(ends) / 2.0 for ends in mains_hum(seen)]
    if hum:
        parts = [without_lines(p, hum, r.spacing) for p, r in zip(parts, seen.data.each, strict=True)]
    lags = min(LAGS, *(len(p) // 4 for p in parts))
    free = lags * len(parts)
    drawn = map(seen.without_memory, seen.rounded)
    expected = max(float(np.mean([memory_square(draw, lags) for draw in drawn] or [free])), free)
    ratio = memory_square(parts, lags) / expected
    yield Finding("autocorrelation", f"{lags} lags", ratio, float(chdtrc(free, ratio * free)))


def memory_square(parts: Sequence[Array], lags: int) -> float:
    """Return the sum of the squared autocorrelations up to a lag, of white noise a chi-square of their number."""
    total = 0.0
    for deviations in (p - np.mean(p) for p in parts):
        n = len(deviations)
        covariance = np.array([deviations[lag:] @ deviations[: n - lag] for lag in range(lags + 1)])
        total += n * (n + 2.0) * float(np.sum((covariance[1:] / covariance[0]) ** 2 / (n - np.arange(1.0, lags + 1.0))))
    return total


def dependence_tests(seen: Residuals) -> Iterator[Finding]:
    """Regress the residual on bins of each variable of the motion, and on twelve parts of each record's time.

    The bins hold about equally many samples; they are filtered as the residual is, and projected off what the fit has
    absorbed. Each output is tested by itself.
    """
    places = np.repeat([r.place for r in seen.replays], np.diff(seen.data.edges))
    outputs = {seen.model.plant.outputs[i].name: places == i for i in sorted(set(places.tolist()))}
    for name, values in seen.variables.items():
        if np.ptp(values) > 0.0:
            edges = np.unique(np.quantile(values, np.linspace(0.0, 1.0, N_BINS + 1)))
            place = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, max(len(edges) - 2, 0))
            for output, samples in outputs.items():
                yield structure(seen, f"{name} in {output}" if len(outputs) > 1 else name, place, samples)
    parts = [np.arange(n) * N_BINS // max(n, 1) for n in np.diff(seen.data.edges)]
    bins = np.concatenate([p + i * N_BINS for i, p in enumerate(parts)])
    for output, samples in outputs.items():
        where = f"time in the record of {output}" if len(outputs) > 1 else "time in the record"
        yield structure(seen, where, bins, samples)


def structure(seen: Residuals, where: str, place: NDArray[np.int64], samples: NDArray[np.bool_]) -> Finding:
    """Test a residual for a part that is constant in each bin; place: the bin of each sample, (n_samples,).

    samples: which of them are looked at, (n_samples,).
    """
    indicators = np.asarray(place[:, np.newaxis] == np.unique(place[samples]), dtype=np.float64)
    indicators *= samples[:, np.newaxis]
    white = seen.data.white(seen.data.by_record(indicators.T)).T
    columns, signals = beyond(seen.basis, white), [seen.residual, *seen.rounded]
    along, (rank, *_) = zip(*(square_along(columns, x) for x in signals), strict=True)
    square, *drawn = (
        along if seen.data.sized else (a / float(np.mean(x**2)) for a, x in zip(along, signals, strict=True))
    )
    # what a sensor rounds away of the motion may depend on it as well
    square /= max(1.0, float(np.mean(drawn or [rank])) / rank)
    if not seen.data.sized:
        # Neighbours tell the same: of the residual's own scatter only the independent samples count.
        square *= seen.data.independent(seen.residual) / len(seen.residual)
    known = seen.data.n_noise(otherwise=np.inf)
    return Finding("dependence", where, square / rank, chance(square / rank, rank, known))


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

    White noise has a flat spectrum, whose level the rest tells, or without one the residual; of coloured noise the
    rest itself shows the spectrum. What a sensor rounds away of the motion has the spectrum of `Residuals.rounded`.
    Where the rest hums, frequencies near by are left out: a line does not scatter as noise does.
    """
    coloured = not (seen.doubted or seen.data.blocks) and seen.data.rests_have_colour
    hum = mains_hum(seen)
    levels = seen.data.levels
    whole = [bridged(x, r) / n.rms for x, r, n in zip(seen.raw, seen.replays, levels, strict=True)] if coloured else []
    left = spectra(whole or seen.renewed, seen, hum)
    # an output with gaps may have no rest where another has one
    still = [(r.rest - np.mean(r.rest)) / n.rms if r.rest.size else r.rest
             for r, n in zip(seen.data.each, levels, strict=True)]  # fmt: skip
    rests = spectra(still, seen, hum) if coloured else {}
    flat = 1.0 if seen.data.sized else float(np.mean(np.concatenate(seen.renewed) ** 2))
    draws = [] if coloured else [seen.without_memory(draw) for draw in seen.rounded]
    drawn = [spectra(draw, seen, hum) for draw in draws]
    mean = float(np.mean(np.concatenate(list(chain.from_iterable(draws))) ** 2)) if drawn else 1.0
    shapes = {band: float(np.mean([np.mean(one[band]) for one in drawn])) if drawn else 1.0 for band in left}
    if not seen.data.known:  # a sensor that rounds is not the only noise
        scale = 1.0 if seen.data.sized else mean
        shapes = {band: max(shape / scale, 1.0) for band, shape in shapes.items()}
    highest = max(0.5 / record.spacing for record in seen.data.each)
    for band, values in sorted(left.items()):
        other = rests.get(band, [])
        if coloured and len(other) < FEWEST_ORDINATES:
            continue
        against = float(np.mean(other)) if coloured else flat * shapes[band]
        ratio, free = float(np.mean(values)) / against, 2.0 * INDEPENDENT * len(values)
        known = 2.0 * INDEPENDENT * len(other) if coloured else seen.data.n_noise(otherwise=np.inf)
        where = f"{BANDS_HZ[band]:g} to {min(BANDS_HZ[band + 1], highest):.3g} Hz"
        yield Finding("frequency", where, ratio, chance(ratio, free, known))


def bridged(signal: Array, replay: Replay) -> Array:
    """Return a signal with invalid samples interpolated linearly: a jump in slow noise would ring."""
    times, spacing = replay.times, replay.record.spacing
    even = np.arange(times[0], times[-1] + 0.5 * spacing, spacing)
    is_nearly_whole = len(times) < len(even) < (1.0 + MOST_BRIDGED) * len(times)
    return np.interp(even, times, signal) if is_nearly_whole else signal


def mains_hum(seen: Residuals) -> list[tuple[float, float]]:
    """Return the stretches of frequency, (low, high) [Hz], in which the rests show the mains or a harmonic of it."""
    sounding = [r for r in seen.data.each if r.noise.source == "rest" and np.ptp(r.rest) > 0.0]
    # tapered, and all equally loud
    rests = [(np.hanning(len(x)) * (x - np.mean(x)) / (np.std(x) * np.sqrt(len(x))), r.spacing)
             for r in sounding for x in (r.rest,)]  # fmt: skip
    if not rests:
        return []
    width = NEXT_TO_LINE / min(len(x) * step for x, step in rests)

    def power(frequency: float) -> float:
        waves = ((x, np.exp(-2j * np.pi * frequency * step * np.arange(len(x)))) for x, step in rests)
        return float(sum(abs(x @ wave) ** 2 for x, wave in waves))

    highest = min(0.5 / step for _, step in rests) - width
    lines = sorted({f * k for f in MAINS_HZ for k in range(1, HARMONICS + 1) if width < f * k < highest})
    found = []
    for f in lines:
        beside = [
            g for k in range(1, BESIDE_LINE + 1) for g in (f - k * width, f + k * width) if 0.0 < g < highest + width
        ]
        ratio = len(beside) * power(f) / sum(map(power, beside))
        # of noise the ratio of such sums of squares has this distribution
        if fdtrc(2 * len(rests), 2 * len(rests) * len(beside), ratio) < SIGNIFICANCE / len(lines):
            found.append((f - width, f + width))
    return found


def without_lines(signal: Array, frequencies: Sequence[float], interval: float) -> Array:
    """Return a signal without the sines of some frequencies [Hz] that fit it best."""
    angles = 2.0 * np.pi * interval * np.outer(np.arange(len(signal)), frequencies)
    waves = np.hstack([np.cos(angles), np.sin(angles)])
    return np.asarray(signal - waves @ np.linalg.lstsq(waves, signal, rcond=None)[0])


def spectra(
    signals: Sequence[Array], seen: Residuals, without: Sequence[tuple[float, float]]
) -> dict[int, list[float]]:  # fmt: skip
    """Return the ordinates of tapered periodograms, band -> mean squares.

    signals: one a record, over the rms of its noise. without: stretches of frequency, (low, high) [Hz], that are left
    out.
    """
    ordinates: dict[int, list[float]] = {}
    for record, signal in zip(seen.data.each, signals, strict=True):
        if not len(signal):  # the rest of a record in motion
            continue
        taper = np.hanning(len(signal) + 2)[1:-1]
        power = np.abs(np.fft.rfft(signal * taper)[1:-1]) ** 2 / float(taper @ taper)
        frequency = np.fft.rfftfreq(len(signal), record.spacing)[1:-1]
        kept = ~np.any([(low < frequency) & (frequency < high) for low, high in without] or [frequency < 0.0], axis=0)
        bands = np.searchsorted(BANDS_HZ, frequency[kept], side="right") - 1
        for band, value in zip(bands, power[kept], strict=True):
            ordinates.setdefault(int(band), []).append(float(value))
    return ordinates
