"""Whether records are what their campaign says: sign, unit, clock, manoeuvre, before anything is identified.

A wrong header or an exchanged file does not stop a search: parameters follow, and the misfit reads like physics. Here
the declared model is fitted roughly to the train records; where it misses more than a tenth of a signal, each of a list
of mistakes is undone in turn, and one is named only where that takes away most of the misfit.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from armid.engine import Calibration, Schedule, probes
from armid.estimation.corrections import WIDER_BOUNDS, Correction, DataIssue, corrections, of_pieces, rms
from armid.estimation.least_squares import WeightedRecords, descend, with_fitted_starts
from armid.model import Array, Manoeuvre, Model, Plant
from armid.model.parameter import powers_of
from armid.problem.problem import ReadyRecord, by_record
from armid.problem.space import Space, space_of
from armid.problem.starts import fits_starts, with_starts
from armid.record import Campaign, Piece, Record
from armid.record.campaign import scaled as scaled_plant
from armid.record.sensor import correlation_sum
from armid.record.table import POSITIONS
from armid.units import shown

# An error (rms over the rms of the signal) up to this is the business of missing effects, not of these checks.
TOLERABLE = 0.1
# Shares of the error that undoing a mistake may leave, and the ratio of errors up to which mistakes are alternatives.
CORRECTED, LEFT, AS_GOOD = 0.4, 0.5, 1.5
# What is left of the error by a factor of two, which a missing spring or friction can imitate.
LEFT_BY_TWO = 0.2
# An error above this, with no candidate of this cosine to the signal: the model explains nothing of it.
NOTHING_GAINED, UNLIKE = 0.95, 0.3
# An error up to this, where the model explains nothing as declared, shows an exchange that a missing effect half hides.
EXCHANGED = 0.6
# A record disagrees if its error is APART_IN_NOISE times that of the others. Errors well below AGREED count as
# agreement.
APART_IN_NOISE, AGREED = 3.0, 0.05
# Candidates spread over the box, samples of all records together that are looked at, least of one record.
N_SPREAD_CHECKED, MOST_CHECKED, FEWEST_CHECKED = 128, 16_000, 500
# The corrections that leave least are fitted once more, as the declared model is: how many, from how many candidates,
# and from how many of the best.
N_LIKELY, N_HARD, N_BEST = 5, 512, 8
MOST_CORRECTED, MOST_APART = 2**24, 6
# What fits nearly as well is looked for at so many candidates each within these shares of the ranges.
N_NEAR, NEAR_SHARES = 64, (0.001, 0.003, 0.01)
# Kinds of issue that name both records, or that the model has against one whatever the other says.
SURE_KINDS = ("exchanged", "unlike", "unjudged")
# Train records up to so many are few; samples that two of them must have in common to be exchanged.
FEW_RECORDS, FEWEST_COMMON = 3, 100
# Share of a signal by which a simulation may change when samples of a long record are left out.
SAME_ERROR = 0.01
# A clock that is off by fewer samples, or by more than this share of the record, is not looked for.
LEAST_SHIFT, MOST_SHIFT = 3, 0.3
# Integration steps between samples, relative fall of squares at which a rough fit has arrived.
SUBSTEPS_CHECKED, CHECK_TOLERANCE = 4, 1e-3
# Longest sample interval of a motion that a motor drives [s].
LONGEST_INTERVAL = 1.0
# A record begins elsewhere than the model where each of so many first samples is more than so many times the noise, and
# than this share of the motion, away.
FIRST_SAMPLES, ELSEWHERE, FAR_OF_MOTION = 3, 10.0, 0.02
# Successive samples, of so many values, that two recordings do not have in common by chance.
ALIKE_VALUES, DIFFERENT = 40, 10
# Rest that scatters by this share of the motion's rms in so few independent samples, or has this mean, is not a rest. A
# ramp has 3, noise of 20 Hz in a rest of 0.1 s has 4.4 and more.
RESTLESS, OF_A_RAMP, LARGE_MEAN = 0.02, 4.0, 0.2


def data_issues(campaign: Campaign, model: Model, space: Space) -> tuple[DataIssue, ...]:
    """Look for mistakes in records: what the files show alone, then against the declared model; the plainest first.

    The model is fitted to train records only; those held out are compared with what that fit predicts.
    """
    campaign = replace(campaign, records=tuple(map(filled, campaign.records)))
    seen = [s for r in campaign.records for one in r.each for s in (*noise_or_rest(one), *of_position(one))]
    seen += list(given_twice(campaign.records))
    noise = {s.record for s in seen if s.kind == "noise"}
    train = [shortened(r, len(campaign.train)) for r in campaign.train if r.file not in noise]
    # no motor-driven machine is sampled so rarely, whatever the declared model makes of it
    times = [DataIssue("time", r.file, f"{r.file}: its samples are {r.manoeuvre.interval:.3g} s apart, which looks "
                       "like times in ms: seconds are expected in time_s.")
             for r in campaign.records if r.manoeuvre.interval >= LONGEST_INTERVAL]  # fmt: skip
    if not train:
        return (*seen, *times)
    trial = DataTrial(model, space).scaled(train)
    train = [trial.thinned(r, len(train)) for r in train]
    z, before = trial.fit(train)
    issues, worst = list[DataIssue](), trial.errors(train, z).max()
    if worst > TOLERABLE:
        begun = started(trial, train, worst)
        if begun is None:
            issues, z = mistakes(trial, train, z, before)
        else:
            train, z = begun
    issues = of_two(issues, train)
    errors = trial.errors(train, z)[0]
    if not issues:
        n = len(campaign.holdout)
        others = [trial.thinned(shortened(r, n), n) for r in campaign.holdout if r.file not in noise]
        others = [placed(trial, r, z) for r in others]
        issues += [s for r in others for s in apart(trial, r, z, float(np.max(errors)))
                   if s.after * AS_GOOD < least_nearby(trial, train, r, z)]  # fmt: skip
        worst = int(np.argmax(errors))
        if not issues and LEFT < errors[worst] < np.inf:
            file = train[worst].file
            issues = [DataIssue("unjudged", file, f"{file}: the declared model, fitted to the train records, leaves "
                                f"{errors[worst]:.0%} of its signal, and no other sign, unit, clock or manoeuvre "
                                "explains that: look at its columns, and at what the model lacks.")]  # fmt: skip
    issues += () if issues else begun_elsewhere(trial, train, z)
    files = {s.record for s in issues if s.kind == "time"}
    return (*seen, *(s for s in times if not files & {"", s.record}), *issues)


def roomy_space(
    campaign: Campaign, model: Model, bounds: Mapping[str, tuple[float, float]] | None = None,
    fixed: Mapping[str, float] | None = None,
) -> Space:  # fmt: skip
    """Return the space of a model, eight times as wide for those strengths that a rough fit takes beyond their range.

    The range of an effect's strength in the machine's scales is a size to expect, and no wall: what a motor's voltage
    brakes at full speed is all that it drives. One that the campaign or the user gave stays. Arguments as `space_of`.
    """
    space = space_of(model, campaign.parameters, bounds, fixed)
    sized = {n for n in sized_parameters(model) if "." in n} & set(space.free_names)
    sized -= {*campaign.parameters, *(bounds or {}), *(fixed or {})}
    if not sized:
        return space
    train = [shortened(filled(r), len(campaign.train)) for r in campaign.train]
    trial = DataTrial(model, space)
    train = [trial.thinned(r, len(train)) for r in train]
    z, error = trial.fit(train)
    roomy = DataTrial(model, space.with_wider(sized))
    problem = roomy.problem(train)
    beyond, less = roomy.fit(train, problem.shares(trial.problem(train).values(z))[None])
    found = problem.values(beyond)
    outside = (found < space.low[space.free]) | (found > space.high[space.free])
    return space.with_wider(sized & set(np.array(space.free_names)[outside].tolist())) if less < error else space


def filled(record: Record) -> Record:
    """Return a record with the straight lines between its samples taken as measured."""
    return record.with_signals(lambda signal: replace(signal, data=None))


class DataTrial:
    """Fit one model to records, and tell its errors on them, each as rms of the residual over rms of the signal.

    Every step between samples is cut into four: rough enough to be quick, and a clock in another unit costs no more.
    """

    def __init__(self, model: Model, space: Space) -> None:
        self.model, self.space = model, space

    def problem(self, records: Sequence[Record]) -> WeightedRecords:
        rough = Calibration(Schedule(SUBSTEPS_CHECKED), np.nan, True)
        prepared = [ReadyRecord(r, self.model, (rough,) * len(r.pieces)) for r in records]
        ready = tuple(one for record in prepared for one in record.each)
        # of an angle or a position the zero says nothing
        moved = [r.measured - (np.mean(r.measured) if r.record.unit in ("rad", "m") else 0.0) for r in ready]
        return WeightedRecords(ready, self.space, tuple(1.0 / max(float(np.linalg.norm(x)), 1e-300) for x in moved))

    def scaled(self, records: Sequence[Record]) -> "DataTrial":
        if not self.model.plant.scales_from_records:
            return self
        model = replace(self.model, plant=scaled_plant(self.model.plant, records, ""))
        old, new = space_of(self.model), space_of(model)
        kept = {n: np.where(getattr(self.space, n) == getattr(old, n), getattr(new, n), getattr(self.space, n))
                for n in ("low", "high")}  # fmt: skip
        return DataTrial(model, replace(self.space, **kept))

    def errors(self, records: Sequence[Record], Z: Array) -> Array:
        """Return the error of each record at candidates in shares, (n_candidates, n_records), inf where it diverges."""
        problem = self.problem(records)
        of = zip(problem.weights, problem.replays, problem.simulated(np.atleast_2d(Z)), strict=True)
        squares = [np.sum((w * (signal - r.measured)) ** 2, axis=1) for w, r, signal in of]
        counts = np.array([len(r.signals) for r in records])
        means = np.add.reduceat(np.array(squares).T, np.cumsum(counts) - counts, axis=1) / counts
        return np.asarray(np.nan_to_num(np.sqrt(means), nan=np.inf))

    def spread(self, records: Sequence[Record], most: int = N_SPREAD_CHECKED) -> Array:
        n_samples, n = sum(r.n_samples for r in records), int(self.space.free.sum())
        spread = probes(np.zeros(n), np.ones(n), max(min(most, MOST_CORRECTED // n_samples), 8))
        # ranges are wide, and most machines lie in their lower part
        spread[::2] **= 3
        return spread

    def thinned(self, record: Record, n_records: int) -> Record:
        """Return a long record with no more samples than it takes to see how candidates move: every so many-th."""
        step = record.n_samples // most_samples(n_records)
        if step < 2 or len(record.pieces) > 1 or record.pieces[0].start_index:
            return record
        Z = self.spread([record], N_BEST)
        signals = self.signals(record, Z)
        while step > 1:
            rarer = every(record, step, self.model.plant)
            kept = [signal[:, -record.pieces[0].window.start % step :: step] for signal in signals]
            pairs = zip(self.signals(rarer, Z), kept, strict=True)
            if all(float(np.linalg.norm(a - b)) <= SAME_ERROR * float(np.linalg.norm(b)) for a, b in pairs):
                return rarer
            step //= 2
        return record

    def signals(self, record: Record, Z: Array) -> list[Array]:
        return [np.nan_to_num(x) for x in self.problem([record]).simulated(Z)]

    def likeness(self, record: Record) -> float:
        problem, Z = self.problem([record]), self.spread([record])
        signals = problem.signals(Z)
        products, sizes = signals @ problem.measured, np.linalg.norm(signals, axis=1)
        return float(np.nanmax(np.abs(products) / np.maximum(sizes, 1e-300), initial=0.0))

    def corrections(self, record: Record, Z: Array) -> Iterator[Correction]:
        return corrections(self.model.plant, record, self.shift(record, Z))

    def shift(self, record: Record, Z: Array) -> int:
        """Return by how many samples the first piece comes too late, 0 where no shift makes it more alike."""
        piece = record.pieces[0]
        x = record.signals[0].seen(piece)
        n = len(x)
        (signals,) = self.signals(replace(record.each[0], pieces=(piece,)), Z)
        product = np.fft.irfft(np.fft.rfft(x, 2 * n) * np.conj(np.fft.rfft(signals, 2 * n)), axis=-1)
        shifts = np.arange(-int(MOST_SHIFT * n), int(MOST_SHIFT * n) + 1)
        # energy of both in the part that they then have in common
        mine, other = np.append(0.0, np.cumsum(x**2)), np.cumsum(np.pad(signals**2, ((0, 0), (1, 0))), axis=1)
        low, high = np.maximum(shifts, 0), np.minimum(n + shifts, n)
        energy = (mine[high] - mine[low]) * (other[:, high - shifts] - other[:, low - shifts])
        cosine = np.where(energy > 0.0, product[:, shifts] / np.sqrt(np.maximum(energy, 1e-300)), 0.0)
        best = int(shifts[np.argmax(cosine.max(axis=0))])
        return best if abs(best) >= LEAST_SHIFT else 0

    def fit(
        self, records: Sequence[Record], starts: Array | None = None, below: float = np.inf, n_best: int = 2
    ) -> tuple[Array, float]:
        """Return the least-squares estimate, (n_free,), and its rms error, from the best of some candidates.

        starts: None: spread ones. below: only where one of the starts has a smaller error, else the best start is kept.
        """
        starts = self.spread(records) if starts is None else starts
        errors = np.array([rms(e) for e in self.errors(records, starts)])
        best = np.argsort(errors, kind="stable")[:n_best]
        if not (self.space.free.any() and errors[best[0]] < below):
            return np.asarray(starts[best[0]]), float(errors[best[0]])
        z = descend(self.problem(records), list(starts[best[np.isfinite(errors[best])]]), CHECK_TOLERANCE)
        return z, rms(self.errors(records, z))

    def fit_hard(self, records: Sequence[Record], others: Sequence[Array]) -> tuple[Array, float]:
        """Return what `fit` does from more candidates, those that fit otherwise changed records among them."""
        spread = self.spread(records, N_HARD)
        # with other bounds there may be other free parameters
        others = [z for z in others if len(z) == spread.shape[1]]
        return self.fit(records, np.vstack([spread, *others]), n_best=N_BEST)


def started(trial: DataTrial, train: Sequence[Record], worst: float) -> tuple[list[Record], Array] | None:
    """Return records with fitted starts, and the estimate from these, if that explains the records; else None.

    The first samples of a noisy position give a poor speed, so that a sound record of little friction drifts away.
    worst: error of the declared model on a record as it was read.
    """
    problem = trial.problem(train)
    if not fits_starts(problem.replays):
        return None
    ready = [one.record for one in by_record(with_fitted_starts(problem.replays, trial.space))]
    z = trial.fit(ready)[0]
    return (ready, z) if trial.errors(ready, z).max() <= most_left(worst) else None


def placed(trial: DataTrial, record: Record, z: Array) -> Record:
    """Return a held-out record that starts where a candidate fits it best, if it explains it so and not as read."""
    before = trial.errors([record], z).max()
    if before <= TOLERABLE:
        return record

    def freed(piece: Piece) -> Piece:
        return replace(piece, shown_start={name: piece.manoeuvre.constants[name] for name in piece.start_deviation})

    problem = trial.problem([record.with_pieces(freed)])
    (ready,) = by_record(with_starts(problem.replays, problem.whole(z[np.newaxis])[0]))
    return ready.record if trial.errors([ready.record], z).max() <= most_left(before) else record


def most_left(before: float) -> float:
    """Return which error may be left of an error where what is undone explains it."""
    return min(CORRECTED * before, LEFT)


def mistakes(
    trial: DataTrial, train: Sequence[Record], z: Array, before: float
) -> tuple[list[DataIssue], Array]:  # fmt: skip
    """Return the mistakes of train records, and the estimate that judges others; z, before: a fit and its rms error."""
    # a correction begins at spread candidates, and is compared with what the declared model was there
    below = max(before, min(rms(e) for e in trial.errors(train, trial.spread(train))))
    tried = []
    for correction in trial.corrections(train[0], np.concatenate([[z], trial.spread(train[:1])])):
        undone = tuple(map(correction.undo, train))
        own = trial.scaled(undone)
        tried.append((*own.fit(undone, below=below), correction, own, undone))
    declared = space_of(trial.model)
    if not all(np.array_equal(getattr(declared, n), getattr(trial.space, n), True) for n in ("low", "high", "fixed")):
        own = DataTrial(trial.model, declared)
        tried.append((*own.fit(train), WIDER_BOUNDS, own, tuple(train)))
    if trial.model.plant.scales_from_records:
        sized = set(sized_parameters(trial.model)) & set(trial.space.free_names)
        own = DataTrial(trial.model, trial.space.with_wider(sized))
        start, error = own.fit(train)
        beyond = names_outside(trial.space, own.problem(train).values(start))
        if beyond:
            words = f"{', '.join(beyond)} may lie outside the range that was searched: with one eight times as wide"
            tried.append((start, error, Correction("bounds", np.nan, words, lambda record: record), own, tuple(train)))
    # a poor fit of the declared model is not a mistake of the records, and of two corrections the better one is named
    likely = sorted(tried, key=lambda t: t[1])[:N_LIKELY]
    starts = [z, *(t[0] for t in likely)]
    z, before = trial.fit_hard(train, starts)
    again = [(own.fit_hard(undone, starts)[1], correction) for _, _, correction, own, undone in likely]
    issues = chosen("", before, again)
    if trial.errors(train, z).max() <= TOLERABLE or any(s.after <= TOLERABLE for s in issues):
        return issues, z
    everywhere, issues = issues, of_few(trial, train, before, below)
    if issues:
        return issues, z
    z = agreed(trial, train, z)
    errors = trial.errors(train, z)[0]
    typical = typical_of(errors)
    least = max(TOLERABLE, APART_IN_NOISE * typical)
    outside = [train[i] for i in np.argsort(-errors)[:MOST_APART] if errors[i] > least]
    issues = exchanged(trial, train, outside, before) or [s for r in outside for s in apart(trial, r, z, typical)]
    if not issues and not everywhere and trial.model.plant.from_rest:
        # a driven machine drifts away from a model without friction
        issues = [DataIssue("unlike", r.file, f"{r.file}: the declared model explains nothing of it, whatever its "
                            f"parameters (error {e:.3g} of the signal), and no other sign, unit, clock or manoeuvre "
                            "that was tried does.") for r, e in zip(train, errors, strict=True)
                  if NOTHING_GAINED < e < np.inf and trial.likeness(r) < UNLIKE]  # fmt: skip
    return issues or everywhere, z


def sized_parameters(model: Model) -> list[str]:
    """Return parameters whose range is a multiple of the machine's scales: a size to expect."""
    strengths = ((f"{e.name}.{p.name}", p) for e in model.effects for p in e.parameters if p.null == 0.0)
    named = [*((p.name, p) for p in model.plant.parameters), *strengths]
    return [name for name, p in named if powers_of(p.unit)]


def names_outside(space: Space, values: Array) -> list[str]:
    """Return the free parameters whose values are outside of a space."""
    low, high = space.low[space.free], space.high[space.free]
    outside = (values < low) | (values > high)
    return [name for name, is_outside in zip(space.free_names, outside, strict=True) if is_outside]


def of_few(trial: DataTrial, train: Sequence[Record], before: float, below: float) -> list[DataIssue]:
    """Return the mistake in one of few records, or the exchange of two, with which the model fits all of them well.

    Of two or three records no majority says which are right: each correction is fitted together with the others.
    """
    if not 1 < len(train) <= FEW_RECORDS:
        return []
    tried = []
    for changes in changes_of_few(trial, train):
        undone = tuple(changes[r.file].undo(r) if r.file in changes else r for r in train)
        own, (file, correction) = trial.scaled(undone), next(iter(changes.items()))
        tried.append((*own.fit(undone, below=below), own, undone, file, correction))
    sufficient, hidden = [], []
    for start, _, own, undone, file, correction in sorted(tried, key=lambda t: t[1])[:N_LIKELY]:
        z, error = own.fit_hard(undone, [start])
        if own.errors(undone, z).max() <= TOLERABLE:
            sufficient.append((error, file, correction))
        elif correction.other and before > NOTHING_GAINED and error <= EXCHANGED:
            hidden.append((error, file, correction))
    if not sufficient:
        best = min(hidden, key=lambda f: f[0], default=None)
        return [] if best is None else [best[2].issue(best[1], before, best[0])]
    first = min(sufficient, key=lambda f: f[0])[1]
    pairs = [(e, m if file == first else replace(m, words=f"{file}: {m.words}")) for e, file, m in sufficient]
    return chosen(first, before, pairs)


def of_two(issues: Sequence[DataIssue], train: Sequence[Record]) -> list[DataIssue]:
    """Return issues, where those against one of two train records say that it may as well be the other."""
    if len(train) != 2:
        return list(issues)
    doubt = f" {train[0].file} and {train[1].file} disagree: one of the two is wrong, and no third record tells which."
    return [replace(s, sentence=f"{s.sentence}{doubt}") if s.record and s.kind not in SURE_KINDS else s for s in issues]


def changes_of_few(trial: DataTrial, train: Sequence[Record]) -> Iterator[dict[str, Correction]]:
    """Yield what may be undone in one record, or in two that are exchanged, file -> correction."""
    for record in train:
        others = trial.fit([r for r in train if r is not record])[0]
        for correction in trial.corrections(record, others[np.newaxis]):
            yield {record.file: correction}
    for a, b in combinations([r for r in train if len(r.pieces) == 1], 2):
        ends = [r.pieces[0].window for r in (a, b)]
        if min(w.stop for w in ends) - max(w.start for w in ends) >= FEWEST_COMMON:
            yield {a.file: told_as(b), b.file: told_as(a)}


def agreed(trial: DataTrial, train: Sequence[Record], z: Array) -> Array:
    """Return the candidate on which most records agree, whatever the others say: sum log(1 + (e/e0)^2) is least."""
    own = [trial.fit([r])[0] for r in train[: 2 * MOST_APART]]
    candidates = np.concatenate([[z], own, trial.spread(train)])
    errors = trial.errors(train, candidates)
    with np.errstate(over="ignore"):
        best = int(np.argmin(np.sum(np.log1p((errors / AGREED) ** 2), axis=1)))
    inside = [r for r, e in zip(train, errors[best], strict=True) if e <= APART_IN_NOISE * typical_of(errors[best])]
    return trial.fit(inside, candidates[best : best + 1])[0] if inside else candidates[best]


def typical_of(errors: Array) -> float:
    """Return the median error of the better half of the records: half of them may be wrong."""
    return float(np.median(np.sort(errors)[: (len(errors) + 1) // 2]))


def apart(trial: DataTrial, record: Record, z: Array, typical: float) -> list[DataIssue]:
    """Return the mistake of one record, judged at a candidate that is not fitted to it, none where it is as others."""
    before = float(trial.errors([record], z)[0, 0])
    if before <= max(TOLERABLE, APART_IN_NOISE * typical):
        return []
    undone = [(m, m.undo(record)) for m in trial.corrections(record, z[np.newaxis])]
    tried = [(float(trial.errors([r], z)[0, 0]), m) for m, r in undone]
    # a short stretch of a motion is like many: one clock is wrong among others only where that says nearly all
    return chosen(record.file, before, [(e, m) for e, m in tried if m.kind != "time" or e <= LEFT_BY_TWO])


def least_nearby(trial: DataTrial, train: Sequence[Record], record: Record, z: Array) -> float:
    """Return the least error of a held-out record at candidates near by that fit the train records tolerably.

    Where next to nothing decides how a machine moves on, as over the top, what they leave open is not a mistake.
    """
    n = len(z)
    near = np.concatenate([z + r * (2.0 * probes(np.zeros(n), np.ones(n), N_NEAR) - 1.0) for r in NEAR_SHARES])
    near = np.clip(near, 0.0, 1.0)
    most = max(TOLERABLE, AS_GOOD * float(trial.errors(train, z).max()))
    near = near[trial.errors(train, near).max(axis=1) <= most]
    return float(np.min(trial.errors([record], near), initial=np.inf)) if len(near) else np.inf


def chosen(record: str, before: float, tried: Iterable[tuple[float, Correction]]) -> list[DataIssue]:
    """Return the correction that leaves least, and those that do as well; none unless it takes most of the error.

    Of those that do as well, one that accuses no record comes first.
    """
    most = most_left(before)
    good = [(e, m) for e, m in tried if e <= (min(most, LEFT_BY_TWO) if m.factor in (0.5, 2.0) else most)]
    if not good:
        return []
    least = min(e for e, _ in good)
    good.sort(key=lambda pair: (pair[0] > AS_GOOD * least, pair[1].kind != "bounds", pair[0]))
    first = good[0][1].issue(record, before, good[0][0])
    equal = [m.words for e, m in good[1:3] if e <= AS_GOOD * least]
    also = f" As well explained by: {'; or '.join(equal)}." if equal else ""
    return [replace(first, sentence=f"{first.sentence}{also}")]


def exchanged(trial: DataTrial, train: Sequence[Record], outside: Sequence[Record], before: float) -> list[DataIssue]:
    """Return the two records that each fit the manoeuvre of the other, none where no exchange explains much."""
    tried = []
    for a, b in combinations(outside, 2):
        as_other = {a.file: told_as(b), b.file: told_as(a)}
        undone = [as_other[r.file].undo(r) if r.file in as_other else r for r in train]
        tried.append((trial.fit(undone)[1], as_other[a.file], a.file))
    best = min(tried, key=lambda t: t[0], default=None)
    return [] if best is None else chosen(best[2], before, [best[:2]])


def told_as(other: Record) -> Correction:
    """Return what gives a record the manoeuvre of another, but for the state from which it starts."""
    manoeuvre = other.pieces[0].manoeuvre
    constants = {n: v for n, v in manoeuvre.constants.items() if not n.startswith("start_")}
    what = "inputs" if manoeuvre.inputs else "manoeuvre"
    words = f"it and {other.file} look exchanged: each with the {what} of the other"

    def driven_as(piece: Piece) -> Piece:
        n = min([piece.window.stop, *map(len, manoeuvre.inputs.values())])
        shorter = replace(piece.with_constants(constants), window=slice(piece.window.start, n)).until_window_end()
        return shorter.with_inputs({name: values[:n] for name, values in manoeuvre.inputs.items()})

    return Correction("exchanged", np.nan, words, of_pieces(driven_as), other.file)


def most_samples(n_records: int) -> int:
    return max(MOST_CHECKED // n_records, FEWEST_CHECKED)


def shortened(record: Record, n_records: int) -> Record:
    """Return a record cut to what is looked at; whole where most of its motion comes later."""
    pieces, left = [], most_samples(n_records)
    for piece in record.pieces:
        start, n = piece.window.start, min(piece.window.stop - piece.window.start, left)
        if n < min(FEWEST_CHECKED, piece.window.stop - start):
            break
        pieces.append(replace(piece, window=slice(start, start + n)).until_window_end())
        left -= n
    short = replace(record, pieces=tuple(pieces))
    return record if rms(short.seen) <= 0.5 * rms(record.seen) else short


def every(record: Record, step: int, plant: Plant) -> Record:
    """Return a record of one piece with every so many-th sample; inputs are averages, so that no impulse is lost."""
    (piece,), holds = record.pieces, {i.name: i.hold or record.manoeuvre.hold for i in plant.inputs}

    def averages(x: Array, hold: str) -> Array:
        # over the samples up to the next that stays, of an input that runs straight over as many on either side
        first = np.maximum(np.arange(0, len(x), step) - (0 if hold == "zero" else step // 2), 0)
        return np.asarray(np.add.reduceat(x, first) / np.diff(np.append(first, len(x))))

    def rarer(old: Manoeuvre) -> Manoeuvre:
        inputs = {name: averages(x, holds[name]) for name, x in old.inputs.items()}
        return replace(old, interval=step * old.interval, n_samples=-(-old.n_samples // step), inputs=inputs)

    window = slice(*(-(-end // step) for end in (piece.window.start, piece.window.stop)))
    kept = replace(piece, manoeuvre=rarer(piece.manoeuvre), window=window)
    thinner = record.with_measured({s.output: s.measured[::step] for s in record.signals})
    return replace(thinner, manoeuvre=rarer(record.manoeuvre), pieces=(kept,))


def begun_elsewhere(trial: DataTrial, train: Sequence[Record], z: Array) -> Iterator[DataIssue]:
    """Yield the angles or positions that in every record begin away from the declared start of the model."""
    plant = trial.model.plant
    away: dict[str, list[tuple[float, str]]] = {}
    for record in train:
        for one, simulated in zip(record.each, trial.signals(record, z[np.newaxis]), strict=True):
            off, piece = one.measured[:FIRST_SAMPLES] - simulated[0][:FIRST_SAMPLES], one.pieces[0]
            least = max(ELSEWHERE * one.noise.rms, FAR_OF_MOTION * float(np.ptp(one.measured)))
            known = one.unit in ("rad", "m") and not piece.window.start and not piece.start_deviation
            if known and abs(np.sign(off).sum()) == off.size and float(np.min(np.abs(off))) > least:
                away.setdefault(one.output, []).append(shown(float(np.mean(off)), one.unit))
    for output, sizes in away.items():
        if len(sizes) == len(train):
            yield DataIssue("start", "", f"{output or plant.outputs[0].name}: every train record begins "
                            f"{min(sizes)[0]:.3g} to {max(sizes)[0]:.3g} {sizes[0][1]} away from where {plant.name} "
                            "starts: another start under [constants], a plant that takes it from the record "
                            "(from_rest = False, start_position), or another zero of the sensor, is expected."
                            )  # fmt: skip


def noise_or_rest(record: Record) -> Iterator[DataIssue]:
    """Yield what the speed of one file shows alone: no motion but noise, or motion where there should be rest."""
    x = record.seen
    n, deviations = len(x), x - np.mean(x)
    lags = range(1, min(20, n // 2))
    correlation = [float(deviations[k:] @ deviations[:-k]) / float(deviations @ deviations) for k in lags]
    if np.max(np.abs(correlation)) < 4.0 / np.sqrt(n):
        yield DataIssue("noise", record.file, f"{record.file}: the measured {record.output or 'speed'} is noise, no "
                        "sample of it is related to the next: a recorded motion is expected.")  # fmt: skip
        return
    rest = record.rest
    if rest.size < 2 or record.is_noise_free:
        return
    scatter, mean = float(np.std(rest)) / rms(x), abs(float(np.mean(rest))) / rms(x)
    independent = rest.size / (1.0 + 2.0 * correlation_sum(rest - np.mean(rest)))
    if mean > LARGE_MEAN or (scatter > RESTLESS and independent < OF_A_RAMP):
        yield DataIssue("rest", record.file, f"{record.file}: the machine is not at rest before t = 0, its speed has a "
                        f"mean of {mean:.2g} and scatters by {scatter:.2g} of the motion's rms there: samples at rest, "
                        "or a clock that begins with the motion, are expected.")  # fmt: skip


def of_position(record: Record) -> Iterator[DataIssue]:
    """Yield a position column that is not the integral of the speed: another sign, unit or clock."""
    for header, (unit, factor) in POSITIONS.items():
        if unit != record.unit or header not in record.columns:
            continue
        position = factor * record.columns[header]
        integral = np.cumsum(record.measured) * record.manoeuvre.interval
        position, integral = position - np.mean(position), integral - np.mean(integral)
        size = float(position @ integral) / max(float(integral @ integral), 1e-300)
        alike = abs(size) * float(np.linalg.norm(integral)) / max(float(np.linalg.norm(position)), 1e-300)
        if alike > 0.9 and not 0.6 < size < 1.6:
            said = f"{record.file}: {header} moves {size:.3g} times as far as the speed says"
            wrong = f"{said}: the sign or unit of one of them, or time_s, looks wrong."
            yield DataIssue("position", record.file, wrong)


def given_twice(records: Sequence[Record]) -> Iterator[DataIssue]:
    """Yield the pairs of records, no repeats of each other, that hold the same samples: one recording given twice.

    Compared are fingerprints of `ALIKE` successive samples; simulations without noise may well agree. What two windows
    of one recording share begins where one of them begins, and ends where one ends; elsewhere a coarse sensor agrees.
    """
    records = [filled(r) for r in records if not r.is_noise_free]
    if len(records) < 2:
        return
    prints, places = zip(*(fingerprints(r.seen) for r in records), strict=True)
    owner = np.concatenate([np.full(len(p), i) for i, p in enumerate(prints)])
    _, place, counts = np.unique(np.concatenate(prints), return_inverse=True, return_counts=True)
    shared = np.flatnonzero(counts[place] > 1)
    groups = np.split(owner[shared][np.argsort(place[shared], kind="stable")], np.cumsum(counts[counts > 1])[:-1])
    for i, j in sorted({pair for group in groups for pair in combinations(np.unique(group).tolist(), 2)}):
        a, b = records[i], records[j]
        _, in_a, in_b = np.intersect1d(prints[i], prints[j], return_indices=True)
        alike = ((places[i], places[i][in_a]), (places[j], places[j][in_b]))
        overlaps = all(any(end(whole) == end(part) for whole, part in alike) for end in (np.min, np.max))
        if a.manoeuvre_file == b.manoeuvre_file or not overlaps:
            continue
        n = len(in_a) + ALIKE_VALUES - 1
        yield DataIssue("twice", a.file, f"{a.file} and {b.file} hold the same {n} samples: one recording is given "
                        "twice, records that do not overlap are expected.")  # fmt: skip


def fingerprints(values: Array) -> tuple[NDArray[np.uint64], NDArray[np.int64]]:
    """Return a number for each run of `ALIKE` samples that takes `DIFFERENT` values or more, and where it first is."""
    n = len(values) - ALIKE_VALUES + 1
    if n < 1:
        return np.empty(0, dtype=np.uint64), np.empty(0, dtype=np.int64)
    bits, hashes = np.ascontiguousarray(values + 0.0).view(np.uint64), np.zeros(n, dtype=np.uint64)
    changes = np.append(0, np.cumsum(values[1:] != values[:-1]))
    for i in range(ALIKE_VALUES):
        hashes = hashes * np.uint64(0x100000001B3) + bits[i : i + n]
        hashes ^= hashes >> np.uint64(29)
    moving = np.flatnonzero(changes[ALIKE_VALUES - 1 :] - changes[:n] >= DIFFERENT)
    found, first = np.unique(hashes[moving], return_index=True)
    return found, moving[first]
