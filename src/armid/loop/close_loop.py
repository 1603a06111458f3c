"""Close the loop: residual, missing effect, extended model, error before and after."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from armid.estimation.advice import Advice, Rival, advise
from armid.estimation.constants import NAMED, moved_record
from armid.estimation.identify import JointErrors, campaign_errors
from armid.estimation.least_squares import Estimates, with_fitted_starts
from armid.estimation.mends import Suspicion
from armid.estimation.screen import AS_GOOD, given_twice, screen
from armid.inference.carry_over import missed_sentences
from armid.inference.checks import holdout_residuals, is_significant, train_residuals
from armid.inference.library import (
    CONSTANT,
    SHOWN_AS,
    UNNAMED,
    EffectKey,
    Library,
    calibrated_replays,
    constant_effects,
    library_of,
)
from armid.inference.missing_signal import Missing
from armid.inference.model import Fit, with_standard_accuracy
from armid.inference.scales import with_scales
from armid.inference.score_test import proven_biases
from armid.inference.whitening import whitened
from armid.loop.constants import (
    ConstantModel,
    Trend,
    answer_of_constants,
    constant_models,
    constants_beside,
    group_beside,
    is_outdone,
    known_together,
    measurements,
    trends_of,
)
from armid.loop.empirical import Term, empirical_term
from armid.loop.equivalence import WITHIN, EffectGroup, group_of, rival_models
from armid.loop.fit import behind, criterion, predicted_alike
from armid.loop.result import (
    BIASED,
    CARRIES_NOT,
    DISAGREES,
    EXPLAINED,
    IMPLAUSIBLE,
    NO_DISCREPANCY,
    PARTLY,
    TOO_ALIKE,
    UNEXPLAINED,
    ClosedLoop,
    Judgement,
    Step,
    Withdrawn,
    estimates,
    unseen_biases_of,
)
from armid.loop.search import COMPARABLE, CREEPS, Search, SearchLevel
from armid.loop.suspects import (
    FREED,
    LEFT_OUT,
    Mended,
    Suspect,
    broken_suspects,
    disagreeing_record,
    mended_records,
    suspect_held_out,
)
from armid.model import EFFECTS, Effect, Model
from armid.model.effects.sensor import sensor_effects
from armid.record import Campaign, Record

LibraryFor = Callable[[Sequence[Record]], Library]
# What is decided, who is suspected, and the train records as they are taken.
Settled = tuple["Decision", list[Suspect], tuple[Record, ...]]
MOST_ADVICE, MOST_RIVALS = 5, 4
# Models of each size whose predictions are compared before a name is claimed.
MOST_COMPARED = 4
# Models of a size beside which a fault of one record is looked for, the best first.
MOST_FAULTY = 4
# Held-out records deny an addition with which their error is so many times that before, and that of the noise.
DENIED, OVER_NOISE = 1.02, 1.1
# Mistakes of the screen of records that leave nothing to search for, and what it tells whatever the loop finds.
GROSS = ("sign", "unit", "time", "angle", "exchanged", "input", "position")
TOLD = (*GROSS, "start", "noise", "rest", "twice")


# Threads of the linear algebra inside our own threads would only wait for each other.
@threadpool_limits.wrap(limits=1, user_api="blas")  # type: ignore[untyped-decorator]
def close_loop(
    model: Model,
    campaign: Campaign,
    candidates: Mapping[str, Effect] | None = None,
    rng: np.random.Generator | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    fixed: Mapping[str, float] | None = None,
    threads: int = 1,
    told: Callable[[str], None] = lambda _: None,
    curve: bool = True,
    progress: Path | None = None,
) -> ClosedLoop:
    """Find what a declared model lacks on the train records of a campaign, and judge it on those held out.

    Identify the declared model; test what remains against noise; score every candidate effect, refit the leading ones,
    add those that earn their parameters; group what cannot be told apart; where none will do, recover the missing
    signal without a form and add an empirical term. Holdout records are simulated after the last decision.

    Parameters
    ----------
    model : Model
        The declared model.
    campaign : Campaign
        Records of one machine.
    candidates : mapping of name to Effect
        Those whose ports the plant does not offer are left out; None: the library, and those of the plant's sensors.
    rng : Generator, optional
        Not drawn from: searches start from evenly spread candidates, so that nothing is random.
    bounds, fixed : mapping of parameter to (low, high) or value, SI
        Of the model or of a candidate.
    threads : int
        Among which candidates are shared; the result does not depend on it.
    told : callable
        Called with a sentence before what takes long.
    curve : bool
        Whether an empirical curve is tried where no effect will do.
    progress : Path, optional
        File in which estimates are kept as they are made: a second start goes on from them.

    Returns
    -------
    ClosedLoop

    Raises
    ------
    ArmidError
        When every candidate of the declared model diverges, and for an unknown parameter.
    """
    candidates = {**sensor_effects(model.plant), **EFFECTS} if candidates is None else candidates
    within = {name: t for name, t in campaign.tolerances.items() if name not in campaign.rough}
    if campaign.rough:
        model = replace(model, plant=model.plant.known_roughly(campaign.rough))
        candidates = {**candidates, **constant_effects(campaign.rough)}

    estimates = None if progress is None else Estimates(progress)
    if estimates:
        told(f"going on from {len(estimates)} fits of {progress}")

    def library_for(records: Sequence[Record]) -> Library:
        """Return the candidates with records, of which those in motion start where the declared model fits best."""
        data = replace(whitened(records, model.plant), estimates=estimates)
        library = library_of(model, candidates, data, campaign.parameters, bounds or {}, fixed or {}, threads, told,
                             within)  # fmt: skip
        posed = library.problem(())
        library = library.about(with_fitted_starts(posed.replays, posed.space), library.misfit)
        return with_scales(library)[0] if model.plant.scales_from_records or library.declared_strengths else library

    library = library_for(campaign.train)
    space = library.space(library.declared, ())
    screened = screen(replace(campaign, records=campaign.train), library.declared, space)
    found, suspects, train, screened = searched(library_for, library, campaign.train, screened)
    implausible = any(s.kind in GROSS for s in screened)
    found = with_curve(found) if curve and not implausible else found
    # Every decision on effects and parameters is made: holdout records are opened here and not before.
    told("judging on the records held out")
    search, library = found.search, found.library
    holdout, stranger = suspect_held_out(found.chosen, campaign.holdout, library)
    suspects += [stranger] if stranger is not None else []
    there = replace(campaign, records=(*train, *holdout))
    judged = [judge(f, found, there, found.members if f is found.chosen else ()) for f in found.path]
    steps, before, after = steps_of(found, judged[1:]), judged[0], judged[-1]
    if after.fails_to_carry_over:  # nothing is claimed that held-out records deny
        steps = tuple(replace(step, claimed=False) for step in steps)
    withdrawn = Withdrawn(steps, after) if steps and is_denied(before, after) else None
    verdicts = verdicts_of(before, after, steps, withdrawn, found)
    if any(s.role == "train" for s in suspects):
        verdicts = (DISAGREES, *(v for v in verdicts if v not in (NO_DISCREPANCY, EXPLAINED)))
    if implausible:
        verdicts = (IMPLAUSIBLE, UNEXPLAINED)
    advice = advice_for(found.contest, found.largest, campaign.gyro_range, threads, told)
    suspects += broken_suspects(campaign.records)
    if withdrawn is not None:  # what is told from here on is of the declared model
        found = replace(found, chosen=found.declared, rivals=(), missing=None, term=None, equal=())
        steps, after = (), before
    every = {
        name: [errors_on(records, j, library) for records in (campaign.train, campaign.holdout)] if suspects else
        [j.train_error, j.holdout_error] for name, j in (("before", before), ("after", after))
    }  # fmt: skip
    # Not of a curve: its kinks spoil the slopes, and what scales it is no physics.
    named = next(f for f in reversed(found.path) if not any(k.is_empirical for k in f.active))
    together = known_together(named, library)
    # A record held out that is one of those to train on is none.
    screened = (*screened, *given_twice(campaign.records))
    # Other suspicions rest on the declared model: they are told where nothing better was found.
    at_a_loss = not {UNEXPLAINED, CARRIES_NOT}.isdisjoint(verdicts)
    told_first = dict.fromkeys(s.sentence for s in screened if s.kind in TOLD or (at_a_loss and s.kind != "unjudged"))
    said = (*told_first, *missed_sentences(after.missed), *next_steps_of(found, suspects))
    return ClosedLoop(there, verdicts[0], verdicts[1:], before, after, steps, withdrawn, found.refused,
                      found.rivals, advice, said, together, tuple(suspects), every, library, search, found.missing,
                      found.term)  # fmt: skip


def searched(
    library_for: LibraryFor, library: Library, train: tuple[Record, ...], screened: Sequence[Suspicion]
) -> tuple["Decision", list[Suspect], tuple[Record, ...], tuple[Suspicion, ...]]:
    """Return what `settled` does, and what remains of the mistakes that the screen suspects.

    What a whole campaign has wrong needs no search. One record, or an input, is accused only where the model at which
    the search ends does not do as well.
    """
    gross = [s for s in screened if s.kind in GROSS]
    if any(not s.record and s.kind != "input" for s in gross):
        return *settled(library_for, library, train, True), tuple(screened)
    found, suspects, left = settled(library_for, library, train, False)
    if all(does_as_well(found.chosen, s) for s in gross):
        return found, suspects, left, tuple(s for s in screened if s not in gross)
    declared = found.declared
    return Decision(found.search, library, declared, declared, declared, ()), [], train, tuple(screened)


def does_as_well(fit: Fit, suspicion: Suspicion) -> bool:
    """Tell whether a model misses an accused record, or all, by no more of the signal than the mended records would."""
    shares = []
    for replay, part in zip(fit.records.replays, train_residuals(fit).raw, strict=True):
        if suspicion.record in ("", replay.record.file):
            about = replay.measured - (np.mean(replay.measured) if replay.record.unit in ("rad", "m") else 0.0)
            shares.append(float(np.sum(part**2)) / max(float(np.sum(about**2)), 1e-300))
    return bool(np.sqrt(np.mean(shares)) <= AS_GOOD * suspicion.after) if shares else False


def settled(library_for: LibraryFor, library: Library, train: tuple[Record, ...], implausible: bool) -> Settled:
    """Suspect the records, then decide.

    A fault of one record that leaves noise, or next to nothing of what was more, is undone, unless one effect or
    constants do clearly better on all records; where several faults of it do as well, the record is left out. So it is
    beside effects that were found already.
    A trend from record to record that leaves noise is undone where it does clearly better than any of these.
    Where nothing does and all but one record agree, that one is left out. Nothing is looked for in implausible records.
    """
    search = Search(library)
    declared = search.start()
    if implausible:
        return Decision(search, library, declared, declared, declared, ()), [], train
    lacks = is_significant(declared)
    mended, trends = (mended_records(declared, library), trends_of(declared, library)) if lacks else ([], [])
    if mended or trends:
        # Of constants and effects only those count that come down to this.
        limit = max([*(m.chi2 for m in mended[:1]), *(t.chi2 for t in trends[:1])]) + WITHIN
        constants = constant_models(declared, declared.products(library.tolerances), library, limit)
        single = search.further(SearchLevel((declared,)), limit, not any(is_significant(m.fit) for m in mended[:1]))
        least = min([*(m.chi2 for m in constants), *([single.chi2] if single is not None else [])], default=np.inf)
        if trends and trends[0].chi2 + WITHIN < min([least, *(m.chi2 for m in mended)]):
            return decided_without_trend(library_for, trends, library, train)
        if mended and mended[0].chi2 < least + WITHIN:
            return decided_without_fault(library_for, mended, library, train)
    faults: list[Mended] = []

    def is_faulty(level: SearchLevel) -> bool:
        """Tell whether a fault of one record explains what is left, and no effect more does clearly better."""
        if level.best.crept:
            return False
        # It may be the fault that makes another model than the true one the best.
        asked = (mended_records(f, search.library) for f in level.fits[:MOST_FAULTY] if is_significant(level.best))
        found: list[Mended] = next(filter(None, asked), [])
        rival = search.further(level, found[0].chi2 + WITHIN, not is_significant(found[0].fit)) if found else None
        if found and (rival is None or found[0].chi2 < rival.chi2 + WITHIN):
            faults.extend(found)
        return bool(faults)

    search.enough = is_faulty
    decided = decide(search)
    if faults and decided.constants is None:
        return decided_without_fault(library_for, faults, library, train)
    return suspected_again(library_for, decided, train)


def suspected_again(library_for: LibraryFor, found: "Decision", train: tuple[Record, ...]) -> Settled:
    """Suspect the records where what was found leaves more than noise, as `settled` does.

    Not where one effect more leaves noise, though it does not earn its place: that speaks for it, not against a record.
    Nor where one of the two crept: what it leaves is no record's.
    """
    more = found.search.of_size(len(found.largest.active) + 1)[:1]
    if found.constants is None and all(is_significant(f) and not f.crept for f in (found.largest, *more)):
        apart = disagreeing_record([found.declared, found.largest])
        if apart is not None:
            train = tuple(r for r in train if r.file != apart.record)
            return unclaimed(decide(Search(library_for(train)))), [apart], train
        trends = trends_of(found.largest, found.library) if found.largest.active else []
        if trends:
            return decided_without_trend(library_for, trends, found.library, train)
    return found, [], train


def decided_without_fault(
    library_for: LibraryFor, mended: Sequence[Mended], library: Library, train: tuple[Record, ...]
) -> Settled:
    """Return what is decided on records without the best of some faults, as `settled` does.

    A fault that left noise is belied where more effects are found without it: then none of these is claimed, nor is
    one beside a record that is left out.
    """
    best, plant, measured = mended[0], library.declared.plant, library.data.records
    faulty = measured[best.index]
    alike = [m for m in mended if m.chi2 < best.chi2 + WITHIN and measured[m.index].file == faulty.file]
    rest = tuple(r for r in train if r.file != faulty.file)
    # Which of two faults it is makes parameters differ by more than their intervals.
    if len(alike) > 1 and len(rest) > 1:
        suspects = [m.suspect(measured[m.index], plant, LEFT_OUT) for m in alike]
        return unclaimed(decide(Search(library_for(rest)))), suspects, rest
    train = tuple(best.fault.trimmed(r, best.value, plant, faulty) if r.file == faulty.file else r for r in train)
    there = library_for(train)
    if best.fault.kind != "label":
        there = with_unknown(there, best.column(there.problem(best.fit.active, best.fit.values)))
    return unless_belied(best, decide(Search(there))), [best.suspect(faulty, plant, FREED)], train


def unless_belied(fault: Mended, decided: "Decision") -> "Decision":
    is_belied = len(decided.chosen.active) > len(fault.fit.active) and not is_significant(fault.fit)
    return unclaimed(decided) if is_belied else decided


def unclaimed(decided: "Decision") -> "Decision":
    """Return what is decided, of which nothing is claimed: a record that is accused may be sound and deny it."""
    return replace(decided, claimed=frozenset())


def decided_without_trend(
    library_for: LibraryFor, trends: Sequence[Trend], library: Library, train: tuple[Record, ...]
) -> Settled:
    """Return what is decided on records without the best of some trends, as `settled` does."""
    best, *others = trends
    alike = [t for t in others if t.chi2 < best.chi2 + WITHIN]
    train = best.undone(train)
    there = with_unknown(library_for(train), best.column)
    return decide(Search(there)), [best.suspect(alike, library)], train


def with_unknown(library: Library, column: NDArray[np.float64]) -> Library:
    """Return the library with a fault among the unknowns of its intervals; column: what its largest size does."""
    return replace(library, data=replace(library.data, freed=column[:, np.newaxis]), _problems={})


def errors_on(records: tuple[Record, ...], judged: Judgement, library: Library) -> JointErrors | None:
    """Return the errors of a model on records as they were read."""
    fit = judged.fit
    moved = [moved_record(r, library.declared.plant, fit.constants) for r in records]
    return campaign_errors(calibrated_replays(moved, fit.model, fit.records.space, fit.values), fit.candidate)


def next_steps_of(found: "Decision", suspects: Sequence[Suspect]) -> tuple[str, ...]:
    """Return what to do next, in words: records to repeat, then constants to measure."""
    said = [f"Record {s.record} once more, or look at how it was made." if s.kind != "trend" else
            f"Record the first manoeuvre once more after {s.record}: that shows whether {s.parameter} has changed."
            for s in suspects]  # fmt: skip
    return (*dict.fromkeys(said), *measurements(found.equal))


@dataclass(frozen=True, eq=False)
class Decision:
    """Hold what the train records decide.

    chosen: the declared model with what it lacks. largest: the last model that earned its effects, named or not.
    groups: of the effects of the chosen one. claimed: names of these. members: other models that cannot be told from
    it. contest: models between which a record more would decide. constants: those that explain the records in the place
    of effects; equal: those that do beside them.
    """

    search: Search
    library: Library
    declared: Fit
    chosen: Fit
    largest: Fit
    groups: Sequence[EffectGroup]
    claimed: frozenset[str] = frozenset()
    refused: EffectGroup | None = None
    rivals: tuple[Fit, ...] = ()
    members: Sequence[Fit] = ()
    contest: Sequence[Rival] = ()
    missing: Missing | None = None
    term: Term | None = None
    constants: ConstantModel | None = None
    equal: Sequence[ConstantModel] = ()

    @property
    def path(self) -> list[Fit]:
        """The declared model, then with one effect more at a time."""
        active = self.chosen.active
        steps = [self.search.reduced(self.chosen, active[:n]) for n in range(1, len(active))]
        return [self.declared, *steps, *([self.chosen] if active or self.constants is not None else [])]


def decide(search: Search) -> Decision:
    """Suspect the constants, then look for effects; all on the train records."""
    library, declared = search.library, search.start()
    within = declared.products(library.tolerances)
    lacks = is_significant(declared)
    beside = constant_models(declared, within, library) if lacks else []
    # Sets of effects can imitate constants that are off, a single one hardly.
    levels = search.run(1) if beside else search.run()
    if len(levels) > 1 and not lacks:
        beside = constant_models(declared, within, library)
    constants = answer_of_constants(beside, levels[-1].best)
    if constants is not None and (constants.is_stretched or levels[-1].best.chi2 < COMPARABLE * constants.fit.chi2):
        # What cannot come down to what the constants leave is given up.
        search.limit = constants.fit.chi2
        more = search.run(known=levels)
        search.limit = np.inf
        if is_outdone(constants, more[-1].best, len(search.library.candidates)):
            levels, constants = more, None
    last, library = levels[-1].best, search.library
    if constants is not None:
        wider = {name: constants.scale * tolerance for name, tolerance in library.tolerances.items()}
        return Decision(search, replace(library, tolerances=wider), declared, constants.fit, last,
                        [group_beside(constants, search)], constants=constants, equal=[constants])  # fmt: skip
    named, groups, refused = largest_named(predicting_best(levels), search)
    rivals = rival_models(named, search.of_size(len(named.active)))
    members = [f for g in groups for n in g.rivals if (f := search.model_with(n, named)) is not None]
    contest = contest_of([*groups, refused], search, last) or contest_of_models(named, rivals)
    return Decision(search, library, declared, named, last, groups, claimed_names(named, search), refused, rivals,
                    [*members, *rivals], contest,
                    equal=beside if len(named.active) == 1 else ())  # fmt: skip


def with_curve(found: Decision) -> Decision:
    """Look for an empirical curve beside the effects, where these leave more than noise, and not for want of a step.

    Not where their fit crept, as its chi2 is not that of its estimate, nor where that of the best with one effect more
    did: how far a name would come is not known, and a curve might stand in its place. The log of rounds says so.
    """
    # Rivals that would do are an answer, though not a name; rivals that leave a discrepancy all the same are none.
    is_answered = found.refused is not None and not is_significant(found.largest)
    more = found.search.of_size(len(found.chosen.active) + 1)[:1]
    crept = next((f for f in (found.chosen, *more) if f.crept), None)
    if found.constants is not None or is_answered:
        return found
    if crept is not None:
        said = f"the fit of {' + '.join(crept.names)} {CREEPS}"
        if is_significant(found.chosen) and said not in {r["refused"] for r in found.search.rounds}:
            found.search.note_round(len(crept.active) + 1, said)
        return found
    missing, term = empirical_term(found.chosen, found.search)
    if term is None:
        return replace(found, missing=missing)
    curves = EffectGroup(term.fit.names[-1], tuple(EffectKey(f"{UNNAMED}{port}").public for port in term.others))
    contest = contest_of(found.groups, found.search, found.largest)
    return Decision(term.search, term.search.library, found.declared, term.fit, found.largest,
                    [*found.groups, curves], missing=missing, term=term, contest=contest)  # fmt: skip


def steps_of(found: Decision, judged: Sequence[Judgement]) -> tuple[Step, ...]:
    """Return one step for each effect of the chosen model, or one for the constants that take their place."""
    if found.constants is not None:
        name, group = found.constants.name, found.groups[0]
        return (Step(name, "", group.rivals, False, True, found.constants.moved, judged[0], group),)
    candidates, others, steps = found.library.candidates, constants_beside(found.equal), []
    for key, after, group in zip(found.chosen.active, judged, found.groups, strict=True):
        constants = tuple(n for n in (group.name, *group.rivals) if n.startswith(CONSTANT))
        effects = tuple(n for n in group.rivals if n not in constants)
        steps.append(Step(key.public, ", ".join(candidates[key.declared].adds), effects, key.is_empirical,
                          key.public in found.claimed, (*constants, *others), after, group))  # fmt: skip
    return tuple(steps)


def predicting_best(levels: Sequence[SearchLevel]) -> list[SearchLevel]:
    """Return the levels that count: where misfit dwarfs the noise, up to the smallest that predicts as the best does.

    There significance is had for nothing, and what wins on train may lose on what was left out.
    """
    earned = [level for level in levels if not level.refused]
    if len(earned) < 2 or not earned[-1].best.dwarfs_noise:
        return earned
    alike = predicted_alike([level.best for level in earned])
    smallest = next(i for i, level in enumerate(earned) if level.best in alike)
    return earned[: smallest + 1]


def largest_named(levels: Sequence[SearchLevel], search: Search) -> tuple[Fit, list[EffectGroup], EffectGroup | None]:
    """Return the largest model none of whose effects could be one of too many, its groups, and what was refused."""
    refused = None
    for level in reversed(levels):
        chosen = search.ordered(search.pruned(inside_its_ranges(level)))
        search.exchange_all(chosen)
        groups = [group_of(chosen, key, search.of_size(len(chosen.active))) for key in chosen.active]
        big = [g for g in groups if g.too_big]
        if not big:
            return chosen, groups, refused
        refused = refused or big[0]
    return levels[0].best, [], refused


def inside_its_ranges(level: SearchLevel) -> Fit:
    """Return the best model, or where a bound holds one of its effects the best without such unless it is far behind.

    A strength or a shape that ends at its bound says that the effect is not what it was declared to be.
    """
    best = level.best
    near = (f for f in level.fits if behind(f, best) < WITHIN)
    return next((f for f in near if not f.is_at_a_bound), best)


def claimed_names(named: Fit, search: Search) -> frozenset[str]:
    """Return the effects of a model that are claimed, by the train records alone.

    Those of a model that leaves noise; where the misfit dwarfs the noise, those that every model holds which predicts
    the parts left out as well as the best does.
    """
    names = frozenset(named.names)
    if not names or not is_significant(named):
        return names
    if not named.dwarfs_noise:
        return frozenset()
    sizes = range(len(named.active) + 1)
    models = [named, *(f for n in sizes for f in search.of_size(n)[:MOST_COMPARED] if f is not named)]
    return names.intersection(*(f.names for f in predicted_alike(models)))


def is_denied(before: Judgement, after: Judgement) -> bool:
    """Tell whether held-out records are simulated clearly worse with what was added than without it."""
    old, new = before.holdout, after.holdout
    if old is None or new is None:
        return False
    is_more = any(e.rmse > OVER_NOISE * new.noise_of[name] for name, e in new.errors.outputs.items())
    return is_more and new.errors.joint_nrmse > DENIED * old.errors.joint_nrmse


def judge(fit: Fit, found: "Decision", campaign: Campaign, members: Sequence[Fit]) -> Judgement:
    """Return errors, parameters and tests of a fit on train and holdout.

    found: the decision to which the fit belongs. members: models that cannot be told from it, over which intervals
    reach.
    """
    library, curved = found.library, any(key.is_empirical for key in fit.active)
    scored = found.declared if curved else fit
    biases = [(s.key.public, s.biases) for s in found.search.scores_at(scored)]
    fit = with_standard_accuracy(fit)
    seen, unseen = train_residuals(fit), holdout_residuals(fit, campaign.holdout, library)
    remains = any(r.diagnosis.significant for r in (seen, unseen) if r is not None)
    # Where constants are others than declared, the candidates are posed with the declared ones.
    if not (remains or curved or fit.constants):
        library.say("looking for what could bias the parameters unseen")
        biases += proven_biases(fit, library, BIASED).items()
    model = Model(library.declared.plant,
                  (*library.declared.effects, *(library.candidates[k.declared] for k in fit.active)))  # fmt: skip
    told = unseen_biases_of(scored if curved else fit, biases)
    return Judgement(fit, model, estimates(fit, library, remains, told, members), seen, unseen)


def verdicts_of(
    before: Judgement, after: Judgement, steps: Sequence[Step], withdrawn: Withdrawn | None, found: "Decision"
) -> tuple[str, ...]:
    """Return the verdicts that hold, each in one word, the one to be told first before the others.

    A term without a name never explains; of what does not carry over nothing is explained.
    """
    denied = withdrawn is not None or after.fails_to_carry_over
    verdicts = [CARRIES_NOT] if denied else []
    is_constant = any(s.effect.startswith(NAMED) for s in steps)
    in_doubt = any(s.alternatives or (s.constants and not is_constant) for s in steps)
    if found.refused is not None or found.rivals or in_doubt:
        verdicts.append(TOO_ALIKE)
    if not steps or withdrawn is not None:
        verdicts += [UNEXPLAINED] if before.diagnosis.significant and found.refused is None else []
    elif after.significant or any(s.empirical for s in steps):
        verdicts.append(PARTLY)
    return tuple(verdicts) or (EXPLAINED if steps else NO_DISCREPANCY,)


def contest_of(groups: Sequence[EffectGroup | None], search: Search, best: Fit) -> list[Rival]:
    """Return the models that differ in the effect of the first group of several, none where nothing is in doubt."""
    in_doubt = next((g for g in groups if g is not None and g.rivals and not g.name.startswith(SHOWN_AS)), None)
    names = () if in_doubt is None else (in_doubt.name, *in_doubt.rivals)[:MOST_RIVALS]
    return [rival(name, fit, best) for name in names if (fit := search.model_with(name, best)) is not None]


def contest_of_models(named: Fit, rivals: Sequence[Fit]) -> list[Rival]:
    """Return a model and its rivals that differ in more effects than one, none where there is no such rival."""
    if not rivals:
        return []
    mine = rival(" + ".join(key.compiled for key in named.active), named, named)
    return [mine, *(rival(" + ".join(r.names), r, named) for r in rivals[: MOST_RIVALS - 1])]


def rival(name: str, fit: Fit, best: Fit) -> Rival:
    # What a sample counts, and one of a record like these will: less than 1 where more than noise is left.
    trust = float(np.mean(best.records.data.trust(best.residual)))
    return Rival(name, fit.records, fit.z, criterion(fit, best.independent), trust)


def advice_for(
    rivals: Sequence[Rival], best: Fit, speed_limit: float | None, threads: int, say: Callable[[str], None]
) -> tuple[Advice, ...]:
    """Return the manoeuvres that would tell rivals apart, best first; none where nothing is in doubt."""
    if len(rivals) < 2:
        return ()
    say(f"looking for a manoeuvre that tells {' and '.join(r.name for r in rivals)} apart")
    replays, levels = best.records.replays, best.records.data.levels
    # of each output the first level, in the order in which `Motions.signals` gives them
    known = dict(sorted(((r.place, level) for r, level in reversed([*zip(replays, levels, strict=True)])),
                        key=lambda pair: pair[0]))  # fmt: skip

    def white(signals: NDArray[np.float64]) -> NDArray[np.float64]:
        pairs = zip(known.values(), signals, strict=True)
        weight = float(np.sqrt(rivals[0].trust))
        return weight * np.concatenate([level.white(y, [y.shape[-1]]) for level, y in pairs], axis=-1)

    return advise(rivals, white, None, speed_limit, threads=threads)[:MOST_ADVICE]
