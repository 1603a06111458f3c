"""Close the loop: residual, missing effect, extended model, error before and after, the record to make next."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from armid.estimation.advice import Advice, Rival, advise
from armid.estimation.constants import CONSTANT_STEP, common_factors, moved_record
from armid.estimation.corrections import DataIssue
from armid.estimation.data_checks import AS_GOOD, data_issues, given_twice
from armid.estimation.design import manoeuvre_grid
from armid.estimation.identify import JointErrors, campaign_errors
from armid.estimation.least_squares import held_by_bound
from armid.inference.candidates import ERROR_OF
from armid.inference.carry_over import in_doubt_sentences, missed_sentences, over_noise
from armid.inference.checks import holdout_residuals, is_significant, train_residuals
from armid.inference.decisions import CLAIMED, DENIED, MENTIONED, OVER_NOISE, WINDOW, WITHIN
from armid.inference.infer import Inference, infer, prepared
from armid.inference.kinds.hypothesis import Hypotheses, Hypothesis, words
from armid.inference.kinds.missing_signal import missing_from
from armid.inference.kinds.same_law import done_together
from armid.inference.library import Library, calibrated_replays
from armid.inference.model import (
    Fit,
    accurate_enough,
    beyond,
    candidate_at,
    decomposed,
    problem_about,
    unless_diverged,
)
from armid.inference.moves import Exploration, constants_instead, without
from armid.inference.whitening import WhiteRecords
from armid.loop.result import (
    HELD,
    INSTEAD,
    ClosedLoop,
    Judgement,
    Step,
    Verdict,
    Withdrawn,
    broken_records,
    estimates,
    record_faults_of,
)
from armid.model import Array, Effect, Model
from armid.problem.problem import by_output
from armid.problem.starts import with_starts
from armid.record import Campaign, Record
from armid.report.document import listed
from armid.units import behind

# Mistakes of the data checks that leave nothing to search for, and what it tells whatever the loop finds.
GROSS = ("sign", "unit", "time", "angle", "exchanged", "input", "position")
OF_SIZE = ("unit", "angle", "input")
TOLD = (*GROSS, "start", "noise", "rest", "twice")


# Threads of the linear algebra inside our own threads would only wait for each other.
@threadpool_limits.wrap(limits=1, user_api="blas")  # type: ignore[untyped-decorator]
def close_loop(
    model: Model,
    campaign: Campaign,
    candidates: Mapping[str, Effect] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    fixed: Mapping[str, float] | None = None,
    threads: int = 1,
    told: Callable[[str], None] = lambda _: None,
    curve: bool = True,
    progress: Path | None = None,
    priors: Mapping[str, float] | None = None,
    within: float = WITHIN,
) -> ClosedLoop:
    """Find what a declared model lacks on the train records of a campaign, and judge it on those held out.

    Infer how probable each missing effect, each fault of a record and something without a name is; take the most
    probable model whose parts all have names; simulate the records held out, and withdraw the last steps that they
    deny.

    Parameters
    ----------
    model : Model
        The declared model.
    campaign : Campaign
        Records of one machine.
    candidates : mapping of name to Effect
        Those whose ports the plant does not offer are left out; None: the library, and those of the plant's sensors.
    bounds, fixed : mapping of parameter to (low, high) or value, SI
        Of the model or of a candidate.
    threads : int
        Among which candidates are shared; the result does not depend on it.
    told : callable
        Called with a sentence before what takes long.
    curve : bool
        Whether the missing signal is recovered where no effect will do.
    progress : Path, optional
        File in which estimates are kept as they are made: a second start goes on from them.
    priors : mapping of effect to probability
        What is known before the records; those that the campaign tells count too.
    within : float
        A parameter is trusted whose 95 % interval is within this share of its value on either side.

    Returns
    -------
    ClosedLoop

    Raises
    ------
    ArmidError
        When every candidate of the declared model diverges, for an unknown parameter, and for a bad prior.
    """
    library, declared = prepared(model, campaign, candidates, bounds, fixed, priors, threads, told, progress)
    space = library.space(library.declared, ())
    issues = data_issues(replace(campaign, records=campaign.train), library.declared, space)
    # A limit that holds a declared parameter looks like a wrong unit of all records, but not like a wrong sign.
    is_held = bool(held_by_bound(declared.records.space, declared.x).any())
    gross = [s for s in issues if s.kind in GROSS
             and not (is_held and not s.record and s.kind in OF_SIZE and s.factor != -1.0)]  # fmt: skip
    issues = tuple(s for s in issues if s in gross or s.kind not in GROSS)
    # What a whole campaign has wrong needs no search.
    if any(not s.record and s.kind != "input" for s in gross):
        library = replace(library, candidates={}, bundles=())
    inference = infer(library, declared)
    best = inference.exploration.fits[inference.in_force]
    # One record, or an input, is accused only where the model at which the search ends does not do as well.
    implausible = bool(gross) and not all(does_as_well(best, s) for s in gross)
    issues = tuple(s for s in issues if implausible or s not in gross)
    # Every decision on effects and parameters is made: holdout records are opened here and not before.
    told("judging on the records held out")
    path = [frozenset[Hypothesis]()] if implausible else path_of(inference)
    judged = [judge(inference, hypotheses, campaign, within) for hypotheses in path]
    # the same model may be asked twice, and each answer takes some fits
    instead = cache(partial(constants_instead, names=campaign.taken_as_exact))
    steps = steps_of(inference, path, judged, instead)
    kept = confirmed(judged)
    unclaimed = tuple(replace(step, claimed=False) for step in steps[kept:])
    withdrawn = Withdrawn(unclaimed, judged[-1], worse_by(judged)) if unclaimed else None
    if kept < len(path) - 1:  # a model of faults alone has no step
        inference, path = inference.without(path[-1] - path[kept], path[kept]), path[: kept + 1]
        judged = rejudged(inference, path, judged, within)
        steps = steps_of(inference, path, judged, instead)
    after = judged[kept]
    accused = [h for h in path[kept] if inference.posterior.probability(*h.public) >= MENTIONED]
    suspects = [*record_faults_of(accused, path[kept], inference), *broken_records(campaign.records)]
    verdicts: tuple[Verdict, ...] = (
        ("implausible_records", "unexplained") if implausible
        else verdicts_of(inference, accused, after, steps[:kept], withdrawn)
    )  # fmt: skip
    if after.fails_to_carry_over:  # nothing is claimed that held-out records deny
        assert after.holdout is not None
        inference = inference.after_holdout(over_noise(after.train, after.holdout))
        judged = rejudged(inference, path, judged, within)
        after = judged[kept]
        steps = tuple(replace(step, claimed=False) for step in steps_of(inference, path, judged, instead))
    if any(step.instead for step in steps[:kept]):
        after = doubted(after, INSTEAD)
    errors = {
        name: [errors_on(records, j, library) for records in (campaign.train, campaign.holdout)] if suspects else
        [None if seen is None else seen.errors for seen in (j.train, j.holdout)]
        for name, j in (("before", judged[0]), ("after", after))
    }  # fmt: skip
    in_force, missing = inference.exploration.fits[path[kept]], None
    if curve and not implausible and is_significant(in_force):
        told("recovering the missing signal without a form")
        missing = missing_from(in_force, inference.exploration.library)
    advice = advice_on(inference, campaign.gyro_range, threads, told) if "cannot_tell_apart" in verdicts else ()
    # Other issues rest on the declared model: they are reported where nothing better was found.
    is_lacking = {"unexplained", "does_not_carry_over", "partly_explained"} & {*verdicts}
    is_nameless = is_lacking and not any(s.claimed for s in steps)
    told_first = dict.fromkeys(s.sentence for s in (*issues, *given_twice(campaign.records))
                               if s.kind in TOLD or (is_nameless and s.kind != "unjudged"))  # fmt: skip
    again = [f"Record {s.record} once more, or look at how it was made." for s in suspects if s.kind != "trend"]
    doubt = [] if after.fails_to_carry_over else in_doubt_sentences(after.train, after.holdout)
    next_steps = (
        *otherwise_than_default(inference.exploration.library),
        *told_first,
        *missed_sentences(after.missed),
        *doubt,
        *limits_of(after),
        *dict.fromkeys(again),
    )
    together = (*known_together(in_force, inference.exploration.library), *beyond_records(inference))
    return ClosedLoop(campaign, verdicts[0], verdicts[1:], judged[0], after, steps[:kept], withdrawn, advice,
                      next_steps, together, tuple(suspects), errors, inference, missing)  # fmt: skip


def otherwise_than_default(library: Library) -> list[str]:
    """Say which forms and shapes of a declared model's effects are not those that it takes where none is given."""
    pairs = zip(library.as_declared.effects, library.declared.effects, strict=True)
    forms = [f"{new.name} is in its form {new.form}" for old, new in pairs if new != old]
    shapes = [f"{', '.join(library.own_shapes)} is fitted"] if library.own_shapes_free else []
    if not forms + shapes:
        return []
    return [f"Otherwise than by default, as the records are more probable so: {'; '.join(forms + shapes)}."]


def doubted(judged: Judgement, why: str) -> Judgement:
    """Return a judgement whose parameters are not to be trusted."""
    estimates = (e if e.low is None else replace(e, doubts=(*e.doubts, why)) for e in judged.estimates)
    return replace(judged, estimates=tuple(estimates))


def does_as_well(fit: Fit, issue: DataIssue) -> bool:
    """Tell whether a model misses an accused record, or all, by no more of the signal than corrected ones would."""
    shares = []
    for replay, part in zip(fit.records.replays, train_residuals(fit).raw, strict=True):
        if issue.record in ("", replay.record.file):
            about = replay.measured - (np.mean(replay.measured) if replay.record.unit in ("rad", "m") else 0.0)
            shares.append(float(np.sum(part**2)) / max(float(np.sum(about**2)), 1e-300))
    return bool(np.sqrt(np.mean(shares)) <= AS_GOOD * issue.after) if shares else False


def path_of(inference: Inference) -> list[Hypotheses]:
    """Return the declared model, then the models that lead to the one in force by one effect at a time.

    Each is the most probable one without an effect of the next. Faults of records are undone with the first effect.
    """
    exploration, model = inference.exploration, inference.in_force
    path = [model] if model else []
    while sum(h.kind == "effect" for h in model) > 1:
        less = [model - {h} for h in sorted(model) if h.kind == "effect"]
        for one in (m for m in less if m not in exploration.fits):
            (gone,) = model - one
            again = unless_diverged(
                partial(without, exploration.fits[model], gone, exploration.library, exploration.scale().weight)
            )
            exploration.take(one, again)
        model = max((m for m in less if m in exploration.fits), key=exploration.log_posterior)
        path.insert(0, model)
    return [frozenset(), *path]


def judge(inference: Inference, model: Hypotheses, campaign: Campaign, within: float) -> Judgement:
    """Return errors, parameters and tests of a model on train and holdout."""
    library, fit = inference.exploration.library, accurate_enough(inference.exploration.fits[model])
    seen, unseen = train_residuals(fit), holdout_residuals(fit, campaign.holdout, library)
    remains = any(r.diagnosis.significant for r in (seen, unseen) if r is not None)
    effects = (library.candidates[k.declared] for k in fit.active)
    extended = Model(library.declared.plant, (*library.declared.effects, *effects))
    return Judgement(fit, extended, estimates(inference, model, fit, remains, within), seen, unseen)


def rejudged(
    inference: Inference, path: Sequence[Hypotheses], judged: Sequence[Judgement], within: float
) -> list[Judgement]:  # fmt: skip
    """Return the models of a path with the estimates that an inference gives them; the errors stay."""
    pairs = zip(path, judged, strict=False)  # after a withdrawal the path is shorter
    return [replace(j, estimates=estimates(inference, m, j.fit, j.significant, within)) for m, j in pairs]


def steps_of(
    inference: Inference, path: Sequence[Hypotheses], judged: Sequence[Judgement],
    instead: Callable[[Exploration, Hypotheses, Hypothesis], Mapping[str, float]],
) -> tuple[Step, ...]:  # fmt: skip
    """Return a step for each effect of the model in force; a model of faults alone has none.

    instead: see `constants_instead`. Where something unknown acts nothing tells whether a constant does as well.
    """
    steps, exploration = [], inference.exploration
    candidates, fit = exploration.library.candidates, exploration.fits[inference.in_force]
    for model, last, after in zip(path[1:], path, judged[1:], strict=False):
        hypothesis = next((h for h in sorted(model - last) if h.kind == "effect"), None)
        if hypothesis is None:
            continue
        p = inference.posterior.probability("effect", hypothesis.name)
        names = tuple(inference.partners(inference.in_force, hypothesis))
        settled = fit.has_arrived and not fit.is_at_a_limit(hypothesis.means)
        port = ", ".join(candidates[hypothesis.means].adds)
        is_wrong = inference.posterior.unknown_is_likely
        constants = {} if is_wrong else instead(exploration, inference.in_force, hypothesis)
        is_claimed = p >= CLAIMED and settled and not constants
        steps.append(Step(hypothesis.name, port, names, is_claimed, p, after, hypothesis.form, constants))
    return tuple(steps)


def confirmed(judged: Sequence[Judgement]) -> int:
    """Return how many steps stand: a last step that held-out records deny goes, earlier ones that they confirm stay."""
    kept = len(judged) - 1
    while kept > 0 and any(is_denied(j, judged[kept]) for j in judged[:kept]):
        kept -= 1
    return kept


def worse_by(judged: Sequence[Judgement]) -> float:
    """Return by which share the last model simulates held-out records worse than the best of those before it."""
    *before, last = (j.holdout.errors.joint_nrmse for j in judged if j.holdout is not None)
    return last / min(before) - 1.0


def is_denied(before: Judgement, after: Judgement) -> bool:
    """Tell whether held-out records are simulated clearly worse with what was added than without it."""
    old, new = before.holdout, after.holdout
    if old is None or new is None:
        return False
    is_more = any(e.rmse > OVER_NOISE * new.noise_of[name] for name, e in new.errors.outputs.items())
    return is_more and new.errors.joint_nrmse > DENIED * old.errors.joint_nrmse


def verdicts_of(
    inference: Inference, accused: Sequence[Hypothesis], after: Judgement, steps: Sequence[Step],
    withdrawn: Withdrawn | None,
) -> tuple[Verdict, ...]:  # fmt: skip
    """Return the verdicts that hold, each in one word, the most important first."""
    post = inference.posterior
    unknown = post.unknown_is_likely
    verdicts: list[Verdict] = ["does_not_carry_over"] if withdrawn is not None or after.fails_to_carry_over else []
    verdicts += ["record_disagrees"] if any(h.kind in ("record", "drift") for h in accused) else []
    in_doubt = any(s.probability < CLAIMED or s.instead for s in steps) if steps else post.nothing < MENTIONED
    if in_doubt and not unknown and withdrawn is None and "record_disagrees" not in verdicts:
        verdicts.append("cannot_tell_apart")
    if unknown:
        verdicts.append("partly_explained" if steps else "unexplained")
    return tuple(verdicts) or ("explained" if steps else "no_discrepancy",)


def limits_of(judged: Judgement) -> list[str]:
    """Return which limits hold a parameter: nobody else is accused of what they cause. 0 is an end of physics."""
    held = [e for e in judged.estimates if HELD in e.doubts and e.value]
    return [f"{e.name} sits at its limit {e.value:.4g}{behind(e.unit)}: widen it (--bounds "
            f"{e.name}=LOW:HIGH), or fix it." for e in held]  # fmt: skip


def errors_on(records: tuple[Record, ...], judged: Judgement, library: Library) -> JointErrors | None:
    """Return the errors of a model on records as they were read."""
    fit = judged.fit
    moved = [moved_record(r, library.declared.plant, fit.constants) for r in records]
    replays = with_starts(calibrated_replays(moved, fit.model, fit.records.space, fit.values), fit.candidate)
    return campaign_errors(replays, fit.candidate) if replays else None


# Manoeuvres that are listed, and models that one has to tell apart.
MOST_ADVICE, MOST_RIVALS = 5, 3


def advice_on(
    inference: Inference, speed_limit: float | None, threads: int, say: Callable[[str], None]
) -> tuple[Advice, ...]:  # fmt: skip
    """Return the manoeuvres that would tell the most probable models apart, best first; none where one stands alone."""
    rivals = rivals_of(inference)
    if len(rivals) < 2:
        return ()
    say(f"looking for a manoeuvre that tells {' and '.join(r.name for r in rivals)} apart")
    best = inference.exploration.fits[inference.in_force]
    # of each output the first level, in the order in which `Motions.signals` gives them
    known = [levels[0] for levels in by_output(best.records.replays, best.records.data.levels).values()]

    def white(signals: Array) -> Array:
        pairs = zip(known, signals, strict=True)
        weight = float(np.sqrt(rivals[0].trust))
        return weight * np.concatenate([level.white(y, [y.shape[-1]]) for level, y in pairs], axis=-1)

    library = inference.exploration.library
    grid = manoeuvre_grid(best.model, library.data.records)
    return advise(rivals, white, grid, speed_limit, threads=threads)[:MOST_ADVICE]


def rivals_of(inference: Inference) -> list[Rival]:
    """Return the most probable models without faults of records whose effects differ, one for each set of names."""
    ranked = [(m, p) for m, p in inference.exploration.ranked() if all(h.kind == "effect" for h in m)]
    rivals: dict[str, Rival] = {}
    for model, p in ranked:
        name = words(model)
        if ranked[0][1] - p > WINDOW or len(rivals) == MOST_RIVALS:
            break
        fit = inference.exploration.fits[model]
        # What a sample counts, and one of a record like these will: less than 1 where more than noise is left.
        trust = float(np.mean(fit.records.data.trust(fit.residual)))
        rivals.setdefault(name, Rival(name, fit.records, fit.z, -2.0 * p, trust, fit.constants))
    return list(rivals.values())


def known_together(fit: Fit, library: Library) -> tuple[str, ...]:
    """Return in words which parameters of the declared model and constants the records give only together.

    What the free strengths of effects make up for counts as unseen. An effect that a parameter is already comes last.
    """
    doubles = dict.fromkeys(f"{key.public} would do what {name} does already, and was not looked for"
                            for key, name in library.left_out.items())  # fmt: skip
    own, strengths = {}, [np.zeros(len(fit.residual))]
    for name, value in fit.values.items():
        owner = library.owner(name)
        if owner is None:
            own[name] = slope(fit, fit.records, name, value)
        elif owner.name.startswith(ERROR_OF):
            own[owner.name.removeprefix(ERROR_OF)] = slope(fit, fit.records, name, 1.0 + value)
        else:
            strengths.append(slope(fit, fit.records, name, value))
    for key in library.candidates:
        if key.name.startswith(ERROR_OF) and key not in fit.active:
            there = problem_about(fit, (*fit.active, key), library)
            own[key.name.removeprefix(ERROR_OF)] = slope(fit, there, f"{key.compiled}.error", 1.0)
    if not own:
        return tuple(doubles)
    basis, _ = decomposed(np.column_stack(strengths))
    products = [replace(p, slope=beyond(basis, p.slope)) for p in fit.products(library.tolerances)]
    return (*common_factors(tuple(own), beyond(basis, np.column_stack([*own.values()])), products), *doubles)


def beyond_records(inference: Inference) -> tuple[str, ...]:
    """Return in words which listed effects no record can separate from other values of the parameters."""
    library, fit = inference.exploration.library, inference.exploration.fits[inference.in_force]
    first_forms = {key.public: key for key in reversed(library.joinable(fit.active))}
    likely = [first_forms[name] for name in inference.probabilities["effects"] if name in first_forms]
    together = {key.public: done_together(fit, key, library) for key in likely}
    return tuple(f"no record can separate {name} from other values of {listed(names)}: the intervals hold both; if "
                 f"{name} does not act on your machine, leave it out (without)"
                 for name, names in together.items() if names)  # fmt: skip


def slope(fit: Fit, records: WhiteRecords, name: str, size: float) -> Array:
    """Return the change of the whitened signal by a parameter, its size taken as 1, about a fit, (n_samples,)."""
    both = np.tile(candidate_at(records, fit.values), (2, 1))
    both[:, records.space.index(name)] += np.array([CONSTANT_STEP, -CONSTANT_STEP]) * size
    upper, lower = replace(records, data=fit.records.data).whole_signals(both)
    return np.asarray((upper - lower) / (2.0 * CONSTANT_STEP))
