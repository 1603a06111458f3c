"""Close the loop: residual, missing effect, extended model, error before and after."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from armid.estimation.identify import campaign_errors
from armid.loop.advice import Advice, Rival, advise
from armid.loop.candidates import SHOWN_AS, Library, base, is_empirical, library_of, shown_name
from armid.loop.diagnose import diagnose, holdout_view, train_view
from armid.loop.empirical import Term, empirical_term, key_of
from armid.loop.equivalence import Group, Likeness, RivalModel, group_of, rival_models
from armid.loop.fit import Fit
from armid.loop.result import (
    EXPLAINED,
    NO_DISCREPANCY,
    PARTLY,
    TOO_ALIKE,
    UNEXPLAINED,
    ClosedLoop,
    Judgement,
    Step,
    estimates,
    public_model,
    unseen,
)
from armid.loop.search import Level, Search
from armid.loop.select import criterion
from armid.loop.whitening import evidence_of
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
    signal without a form and add an empirical term. Holdout records are simulated after the last decision. Nothing is
    random: searches start from evenly spread candidates, so that `rng` is not drawn from.
    candidates: name -> effect; those whose ports the plant does not offer are left out. bounds, fixed: parameter -> SI,
    of the model or of a candidate. told: called with a sentence before what takes long.

    Raises ArmidError when every candidate of the declared model diverges, and for an unknown parameter.
    """
    evidence = evidence_of(campaign.train, model.plant)
    library = library_of(model, candidates, evidence, campaign.parameters, bounds or {}, fixed or {}, threads, told)
    search = Search(library)
    levels = search.run()
    named, groups, refused = settled(levels, search)
    declared, chosen = levels[0].best, named
    # Rivals that would do are an answer, though not a name; rivals that leave a discrepancy all the same are none.
    answered = refused is not None and not diagnose(train_view(levels[-1].best)).significant
    missing, term = (None, None) if answered else empirical_term(declared, named, search)
    rivals = rival_models(named, search.of_size(len(named.active)), library) if term is None else ()
    if term is not None:
        chosen, search, library, refused = term.fit, term.search, term.search.library, None
        kept = [g for g, key in zip(groups, named.active, strict=True) if key in chosen.active]
        groups = [*kept, group_of_term(term)]
    # Every decision on effects and parameters is made: holdout records are opened here and not before.
    told("judging on the records held out")
    path = [declared, *prefixes(chosen, search)]
    bends = unseen(declared, search.trace(declared), library)
    judged = [judge(fit, library, campaign.holdout, bends) for fit in path]
    steps = tuple(step_of(key, judged[i + 1], groups[i], library) for i, key in enumerate(chosen.active))
    verdict = verdict_of(judged[0], judged[-1], steps, refused, rivals)
    noise = float(np.mean([level.rms for level in evidence.levels]))
    contest = contest_of(rivals_of(groups, refused), search, levels[-1].best) or whole_contest(named, rivals)
    advice = advice_for(contest, levels[-1].best, campaign.gyro_range, threads, told)
    return ClosedLoop(campaign, noise, verdict, judged[0], judged[-1], steps, refused, rivals, advice, library, search,
                      missing, term)  # fmt: skip


def settled(levels: Sequence[Level], search: Search) -> tuple[Fit, list[Group], Group | None]:
    """Return the largest model none of whose effects could be one of too many, its groups, and what was refused."""
    refused = None
    for level in reversed(levels):
        chosen = search.ordered(level.best)
        groups = [group_of(chosen, key, level.fits[1:], search.library) for key in chosen.active]
        big = [g for g in groups if g.too_big]
        if not big:
            return chosen, groups, refused
        refused = refused or big[0]
    return levels[0].best, [], refused


def prefixes(chosen: Fit, search: Search) -> list[Fit]:
    """Return the fits with the first effect, the first two, and so on, up to the chosen one."""
    sizes = range(1, len(chosen.active))
    return [search.reduced(chosen, chosen.active[:n]) for n in sizes] + ([chosen] if chosen.active else [])


def judge(
    fit: Fit, library: Library, holdout: tuple[Record, ...], bends: Mapping[str, Sequence[tuple[float, str]]]
) -> Judgement:
    """Return errors, parameters and tests of a fit on train and holdout; bends: see `unseen`."""
    train, unseen = train_view(fit), holdout_view(fit, holdout, library)
    diagnosis = diagnose(train)
    unseen_diagnosis = None if unseen is None else diagnose(unseen)
    train_error = campaign_errors(train.replays, fit.candidate)
    assert train_error is not None
    remains = diagnosis.significant or (unseen_diagnosis is not None and unseen_diagnosis.significant)
    return Judgement(
        fit, public_model(fit, library), estimates(fit, library, remains, bends), train, unseen, train_error,
        None if unseen is None else campaign_errors(unseen.replays, fit.candidate), diagnosis, unseen_diagnosis,
    )  # fmt: skip


def step_of(key: str, after: Judgement, group: Group, library: Library) -> Step:
    """Return the step that added an effect."""
    effect, empirical = library.originals[base(key)], is_empirical(base(key))
    return Step(library.public(key), ", ".join(effect.adds), group.names[1:], empirical, after, group)


def group_of_term(term: Term) -> Group:
    """Return the group of an empirical term: the ports at which a curve would do as well."""
    names = dict.fromkeys(shown_name(key_of(d.port)) for d in term.others)
    return Group(shown_name(key_of(term.dependence.port)), tuple(Likeness(n, 0.0, 1.0) for n in names), ())


def verdict_of(
    before: Judgement, after: Judgement, steps: Sequence[Step], refused: Group | None, rivals: Sequence[RivalModel]
) -> str:
    """Return the verdict in one word; a term without a name never explains, and a name in doubt is told first."""
    if refused is not None or rivals:
        return TOO_ALIKE
    if not steps:
        return UNEXPLAINED if before.diagnosis.significant else NO_DISCREPANCY
    if after.significant or any(s.empirical for s in steps):
        return PARTLY
    return TOO_ALIKE if any(s.alternatives or s.group.unlike for s in steps) else EXPLAINED


def rivals_of(groups: Sequence[Group], refused: Group | None) -> list[tuple[str, ...]]:
    """Return the names of effects in each group of more than one."""
    whole = [*groups, *([refused] if refused is not None else [])]
    found = [(g.name, *(r.name for r in (*g.alike, *g.unlike))) for g in whole if g.alike or g.unlike]
    return [names for names in found if not names[0].startswith(SHOWN_AS)]


def contest_of(groups: Sequence[tuple[str, ...]], search: Search, best: Fit) -> list[Rival]:
    """Return the models that differ in the effect of the first group, none where nothing is in doubt."""
    fits = [(name, search.model_with(name, best)) for name in (groups[0] if groups else ())[:MOST_RIVALS]]
    return [rival(name, fit, best) for name, fit in fits if fit is not None]


def whole_contest(named: Fit, rivals: Sequence[RivalModel]) -> list[Rival]:
    """Return a model and its rivals that differ in more effects than one, none where there is no such rival."""
    if not rivals:
        return []
    mine = rival(" + ".join(map(base, named.active)), named, named)
    return [mine, *(rival(" + ".join(r.names), r.fit, named) for r in rivals[: MOST_RIVALS - 1])]


def rival(name: str, fit: Fit, best: Fit) -> Rival:
    """Return a model as the advice takes it."""
    return Rival(name, fit.records, fit.z, criterion(fit, best.independent))


def advice_for(
    rivals: Sequence[Rival], best: Fit, speed_limit: float | None, threads: int, told: Callable[[str], None]
) -> tuple[Advice, ...]:
    """Return the manoeuvres that would tell rivals apart, best first; none where nothing is in doubt."""
    if len(rivals) < 2:
        return ()
    told(f"looking for a manoeuvre that tells {' and '.join(r.name for r in rivals)} apart")
    level = best.records.evidence.levels[0]
    found = advise(rivals, lambda signals: level.white(signals, [signals.shape[-1]]), None, speed_limit,
                   threads=threads)  # fmt: skip
    return found[:MOST_ADVICE]
