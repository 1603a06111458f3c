"""Close the loop: residual, missing effect, extended model, error before and after."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from armid.estimation.identify import campaign_errors
from armid.loop.advice import Advice, Rival, advise
from armid.loop.candidates import SHOWN_AS, UNNAMED, EffectKey, Library, library_of
from armid.loop.diagnose import diagnose, holdout_residuals, train_residuals
from armid.loop.empirical import empirical_term
from armid.loop.equivalence import EffectGroup, Likeness, RivalModel, group_of, rival_models
from armid.loop.fit import Fit
from armid.loop.result import (
    EXPLAINED,
    NO_DISCREPANCY,
    PARTLY,
    TOO_ALIKE,
    UNEXPLAINED,
    Biases,
    ClosedLoop,
    Judgement,
    Step,
    estimates,
    unseen_biases_of,
)
from armid.loop.search import Search, SearchLevel
from armid.loop.select import criterion
from armid.loop.whitening import whitened
from armid.model import EFFECTS, Effect, Model
from armid.record import Campaign, Record

MOST_ADVICE, MOST_RIVALS = 5, 4


def close_loop(
    model: Model,
    campaign: Campaign,
    candidates: Mapping[str, Effect] = EFFECTS,
    rng: np.random.Generator | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    fixed: Mapping[str, float] | None = None,
    threads: int = 1,
    told: Callable[[str], None] = lambda _: None,
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
        Those whose ports the plant does not offer are left out.
    rng : Generator, optional
        Not drawn from: searches start from evenly spread candidates, so that nothing is random.
    bounds, fixed : mapping of parameter to (low, high) or value, SI
        Of the model or of a candidate.
    threads : int
        Among which candidates are shared; the result does not depend on it.
    told : callable
        Called with a sentence before what takes long.

    Returns
    -------
    ClosedLoop

    Raises
    ------
    ArmidError
        When every candidate of the declared model diverges, and for an unknown parameter.
    """
    data = whitened(campaign.train, model.plant)
    library = library_of(model, candidates, data, campaign.parameters, bounds or {}, fixed or {}, threads, told)
    search = Search(library)
    levels = search.run()
    declared, last = levels[0].best, levels[-1].best
    named, groups, refused = largest_named(levels, search)
    # Rivals that would do are an answer, though not a name; rivals that leave a discrepancy all the same are none.
    answered = refused is not None and not diagnose(train_residuals(last)).significant
    missing, term = (None, None) if answered else empirical_term(declared, named, search)
    rivals = rival_models(named, search.of_size(len(named.active))) if term is None else ()
    chosen = named
    if term is not None:
        chosen, search, library, refused = term.fit, term.search, term.search.library, None
        names = dict.fromkeys(EffectKey(f"{UNNAMED}{d.port}").public for d in term.others)
        kept = [g for g, key in zip(groups, named.active, strict=True) if key in chosen.active]
        groups = [*kept, EffectGroup(chosen.active[-1].public, tuple(Likeness(n, 0.0, 1.0) for n in names), ())]
    # Every decision on effects and parameters is made: holdout records are opened here and not before.
    told("judging on the records held out")
    path = [declared, *(search.reduced(chosen, chosen.active[:n]) for n in range(1, len(chosen.active)))]
    path += [chosen] if chosen.active else []
    biases = unseen_biases_of(declared, search.scores_at(declared))
    judged = [judge(fit, library, campaign.holdout, biases) for fit in path]
    steps = tuple(
        Step(key.public, ", ".join(library.originals[key.declared].adds), group.names[1:], key.is_empirical, after,
             group)
        for key, after, group in zip(chosen.active, judged[1:], groups, strict=True)
    )  # fmt: skip
    verdict = verdict_of(judged[0], judged[-1], steps, refused, rivals)
    noise = float(np.mean([level.rms for level in data.levels]))
    contest = contest_of(groups, refused, search, last) or contest_of_models(named, rivals)
    advice = advice_for(contest, last, campaign.gyro_range, threads, told)
    return ClosedLoop(campaign, noise, verdict, judged[0], judged[-1], steps, refused, rivals, advice, library, search,
                      missing, term)  # fmt: skip


def largest_named(levels: Sequence[SearchLevel], search: Search) -> tuple[Fit, list[EffectGroup], EffectGroup | None]:
    """Return the largest model none of whose effects could be one of too many, its groups, and what was refused."""
    refused = None
    for level in reversed(levels):
        chosen = search.ordered(level.best)
        groups = [group_of(chosen, key, level.fits[1:]) for key in chosen.active]
        big = [g for g in groups if g.too_big]
        if not big:
            return chosen, groups, refused
        refused = refused or big[0]
    return levels[0].best, [], refused


def judge(fit: Fit, library: Library, holdout: tuple[Record, ...], biases: Biases) -> Judgement:
    """Return errors, parameters and tests of a fit on train and holdout; biases: see `unseen_biases_of`."""
    seen, unseen = train_residuals(fit), holdout_residuals(fit, holdout, library)
    diagnosis, unseen_diagnosis = diagnose(seen), None if unseen is None else diagnose(unseen)
    train_error = campaign_errors(seen.replays, fit.candidate)
    assert train_error is not None
    remains = diagnosis.significant or (unseen_diagnosis is not None and unseen_diagnosis.significant)
    return Judgement(
        fit, library.public_model(fit.active), estimates(fit, library, remains, biases), seen, unseen, train_error,
        None if unseen is None else campaign_errors(unseen.replays, fit.candidate), diagnosis, unseen_diagnosis,
    )  # fmt: skip


def verdict_of(
    before: Judgement, after: Judgement, steps: Sequence[Step], refused: EffectGroup | None,
    rivals: Sequence[RivalModel],
) -> str:  # fmt: skip
    """Return the verdict in one word; a term without a name never explains, and a name in doubt is told first."""
    if refused is not None or rivals:
        return TOO_ALIKE
    if not steps:
        return UNEXPLAINED if before.diagnosis.significant else NO_DISCREPANCY
    if after.significant or any(s.empirical for s in steps):
        return PARTLY
    return TOO_ALIKE if any(s.alternatives or s.group.unlike for s in steps) else EXPLAINED


def contest_of(groups: Sequence[EffectGroup], refused: EffectGroup | None, search: Search, best: Fit) -> list[Rival]:
    """Return the models that differ in the effect of the first group of several, none where nothing is in doubt."""
    in_doubt = [g for g in (*groups, *([refused] if refused is not None else [])) if g.alike or g.unlike]
    named = [g for g in in_doubt if not g.name.startswith(SHOWN_AS)][:1]
    names = [name for g in named for name in (g.name, *(r.name for r in (*g.alike, *g.unlike)))]
    fits = [(name, search.model_with(name, best)) for name in names[:MOST_RIVALS]]
    return [rival(name, fit, best) for name, fit in fits if fit is not None]


def contest_of_models(named: Fit, rivals: Sequence[RivalModel]) -> list[Rival]:
    """Return a model and its rivals that differ in more effects than one, none where there is no such rival."""
    if not rivals:
        return []
    mine = rival(" + ".join(key.compiled for key in named.active), named, named)
    return [mine, *(rival(" + ".join(r.names), r.fit, named) for r in rivals[: MOST_RIVALS - 1])]


def rival(name: str, fit: Fit, best: Fit) -> Rival:
    return Rival(name, fit.records, fit.z, criterion(fit, best.independent))


def advice_for(
    rivals: Sequence[Rival], best: Fit, speed_limit: float | None, threads: int, say: Callable[[str], None]
) -> tuple[Advice, ...]:
    """Return the manoeuvres that would tell rivals apart, best first; none where nothing is in doubt."""
    if len(rivals) < 2:
        return ()
    say(f"looking for a manoeuvre that tells {' and '.join(r.name for r in rivals)} apart")
    level = best.records.data.levels[0]
    found = advise(rivals, lambda signals: level.white(signals, [signals.shape[-1]]), None, speed_limit,
                   threads=threads)  # fmt: skip
    return found[:MOST_ADVICE]
