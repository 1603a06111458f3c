"""Simulate, identify, examine and close the loop by names: a campaign's folder, an identifier, a fitness, effects.

Every name may be the object itself: a Campaign or tables of pandas, a Plant, an Effect, a Fitness or a function, an
Identifier, an algorithm of pymoo. The commands and `armid` itself call these functions. `identify` describes the
arguments that several of them take.
"""

import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from armid.errors import ArmidError, DataError, ModelError, nearest, nearest_registered, quoted
from armid.model import Array, Effect, Manoeuvre, Model, Plant, effect_name, effect_named, refusal_of
from armid.model.effects.sensor import sensor_effects
from armid.model.parameter import warn_if_far, warn_of_far
from armid.progress import announced, search_bar, status_line
from armid.record import Campaign, read_campaign
from armid.record.campaign import campaign_of_tables, warned_once
from armid.record.schema import Known
from armid.registry import Registry, load_registry, name_of
from armid.units import ANGLES, angles_in

if TYPE_CHECKING:
    from numpy.typing import ArrayLike
    from pandas import DataFrame
    from pymoo.core.algorithm import Algorithm

    from armid.engine import Schedule
    from armid.estimation.bootstrap import Refined
    from armid.estimation.examine import Examination
    from armid.estimation.identify import Identification
    from armid.identifiers import Identifier
    from armid.loop import ClosedLoop
    from armid.problem.fitness import Fitness
    from armid.problem.meter import Meter
    from armid.problem.space import Space

    CampaignLike: TypeAlias = str | Path | Campaign | DataFrame | Sequence[DataFrame] | Mapping[str, DataFrame]
    FitnessLike: TypeAlias = str | Fitness | Callable[..., Any]
    IdentifierLike: TypeAlias = str | Identifier | Algorithm | Callable[..., Any]

Named: TypeAlias = Iterable[str | Effect] | str | Effect
Bounds: TypeAlias = Mapping[str, tuple[float, float]]
Window: TypeAlias = tuple[float, float]
# Of studies/benchmark.toml (30 arms, 20 identifiers, with and without noise) no identifier ends nearer to the truth
# than this one on the rmse with 3,000 simulations, and the swarm before it looks at the whole box.
IDENTIFIER, USUAL_FITNESS, USUAL_BUDGET = "pso+least_squares", "rmse", 3_000
# Where the fitness is not a sum of squares: the best optimiser that needs no residual vectors.
WITHOUT_RESIDUALS = "cmaes"
# The paper's section IV: swarm, similarity degree, 150 iterations of 80 particles, the first 0.7 s.
PAPER_IDENTIFIER, PAPER_FITNESS, PAPER_BUDGET, PAPER_WINDOW = "pso", "similarity", 12_000, (0.0, 0.7)


def opened(
    campaign: Any, effects: Named = (), plugins: Iterable[str] = (), window: Window | None = None,
    bounds: Bounds | None = None, fix: Mapping[str, float] | None = None, plant: str | Plant | None = None,
    model: Model | None = None, units: str | None = None,
) -> tuple[Registry, Campaign, Model]:  # fmt: skip
    """Return catalogues, campaign and model that the arguments name; model: used instead of the declared one."""
    refuse_others(effects, plugins, window, bounds, fix)
    registry = load_registry(plugins)
    if isinstance(plant, Plant):
        registry.plants[plant.name] = plant
    read = campaign if isinstance(campaign, Campaign) else campaign_of(campaign, plant, registry)
    if window is not None:
        read = read.with_window(*window)
    if units is not None:
        if units not in ANGLES:
            raise ArmidError(f"units is {quoted(units)}: {nearest(str(units), ANGLES)}")
        read = replace(read, angle=units)
    effects_known = registry.effects_for(read.plant)
    if model is not None and not isinstance(model, Model):
        raise ModelError(f"model is {quoted(model)}: a Model is expected; plant= names a plant")
    if model is None:
        for text in read.effects:
            chosen(effect_name(text), {**sensor_effects(read.declared), **effects_known}, "effect")
        model = read.model(registry.effects)
    for effect in each_of(effects):
        model = model + effect_of(effect, effects_known, read.plant)
    warn_of_far(model.parameters, fix or {}, bounds or {})
    return registry, read, model


def refuse_others(effects: Any, plugins: Any, window: Any, bounds: Any, fix: Any) -> None:
    """Raise ArmidError for an argument that has not the form that `identify` describes."""
    pair = (list, tuple)
    forms = {
        "effects": (effects, isinstance(effects, str | Effect | Iterable), "names or Effects are"),
        "plugins": (plugins, isinstance(plugins, Iterable) and not isinstance(plugins, str),
                    "a list of FILE.py:attribute is"),
        "window": (window, window is None or (isinstance(window, pair) and are_numbers(window, 2)),
                   "(begin, end), s, is"),
        "bounds": (bounds, bounds is None or (isinstance(bounds, Mapping) and all(
            isinstance(ends, pair) and are_numbers(ends, 2) for ends in bounds.values())), "name -> (low, high) is"),
        "fix": (fix, fix is None or (isinstance(fix, Mapping) and are_numbers(fix.values())), "name -> value is"),
    }  # fmt: skip
    for name, (value, is_right, form) in forms.items():
        if not is_right:
            raise ArmidError(f"{name} is {quoted(value)}: {form} expected")


def are_numbers(values: Iterable[Any], n: int | None = None) -> bool:
    items = list(values)
    return (n is None or len(items) == n) and all(isinstance(v, int | float | np.number) for v in items)


def campaign_of(given: Any, plant: Any, registry: Registry) -> Campaign:
    """Return a campaign that is read from its folder, or made of tables as if they were its files."""
    if isinstance(given, str | Path):
        with announced(f"reading campaign {given}"):
            return read_campaign(given, registry.plants, registry.effects)
    items = given.values() if isinstance(given, Mapping) else given if isinstance(given, list | tuple) else [given]
    tables: list[Any] = list(items)
    if not tables or not all(hasattr(each, "to_csv") for each in tables):
        raise DataError(f"the campaign is a {type(given).__name__}: a folder, a Campaign or pandas DataFrames are "
                        "expected")  # fmt: skip
    if plant is None:
        raise DataError("a campaign of tables needs its plant: plant='driven_axis' or another is expected")
    names = [str(n) for n in given] if isinstance(given, Mapping) else [f"table_{i + 1}" for i in range(len(tables))]
    for name in names:
        if {"/", "\\"} & {*name}:
            raise DataError(f"the table {quoted(name)} is called like a path: a name without a folder is expected")
    named = plant.name if isinstance(plant, Plant) else plant
    return campaign_of_tables(named, dict(zip(names, tables, strict=True)), registry.plants, registry.effects)


def each_of(given: Any) -> Iterator[Any]:
    """Yield the names and Effects of one or several; a text may hold names between commas."""
    for one in [given] if isinstance(given, str | Effect) else given:
        yield from one.split(",") if isinstance(one, str) else [one]


def effect_of(given: Any, effects: Mapping[str, Effect], plant: Plant) -> Effect:
    """Return an effect by its name, in the form of a word or else in the first form that the plant takes."""
    if isinstance(given, Effect):
        return given
    text = str(given).strip()
    chosen(effect_name(text), effects, "effect")
    return effect_named(text, effects, plant)


def chosen(name: str, known: Mapping[str, object], what: str) -> Any:
    if name not in known:
        raise ModelError(f"{what} '{name}' is not known: {nearest_registered(str(name), known)}")
    return known[name]


def identify(
    campaign: "CampaignLike", model: Model | None = None, space: "Space | None" = None,
    fitness: "FitnessLike | None" = None, identifier: "IdentifierLike | None" = None, budget: int | None = None,
    seed: int = 1, target: float | None = None, accuracy: str | None = None,
    progress: "Callable[[Meter | Refined], None] | bool | None" = None, *, options: Mapping[str, Any] | None = None,
    paper: bool = False, interval: bool = True, effects: Named = (), plugins: Iterable[str] = (),
    window: Window | None = None, bounds: Bounds | None = None, fix: Mapping[str, float] | None = None,
    plant: str | Plant | None = None, units: str | None = None, threads: int = 1,
) -> "Identification":  # fmt: skip
    """Identify parameters from the train records of a campaign; `armid.identify("folder")` is enough.

    The records are checked first: a sign, unit, clock or manoeuvre that looks wrong gives a warning.

    Parameters
    ----------
    campaign : path, Campaign, or pandas DataFrames
        The folder or its campaign.toml; or tables with the headers of the CSV files, `table.attrs` of each holds the
        keys of its [[records]] entry.
    model, space : optional
        The model and the box of its parameters, in place of those that the other arguments describe.
    fitness : name, Fitness or function (measured, simulated), default "rmse"; "rmse:hub_angle" for one output
        What is minimised.
    identifier : name, Identifier, pymoo algorithm or function
        The optimiser; by default "pso+least_squares", and "cmaes" for a fitness that is not a sum of squares.
    budget : int
        Simulations, one candidate through all train records counting as one; by default 3,000, and 12,000 (the paper's)
        for an identifier that is named.
    seed, options
        Of the identifier: that of its random numbers, and name -> value.
    target : float
        Fitness at which to stop (the paper's step 7).
    accuracy : {"standard", "fine"}
        Of the engine; None: as the noise of each record asks for.
    progress : True or callable
        True shows a bar, in a terminal or a notebook; a function is called with the meter after each
        generation, and with the draws refined so far while a bootstrap runs.
    paper : bool
        The paper's swarm, similarity degree, budget and window, where nothing else is given.
    interval : bool
        Whether intervals are wanted; for a fitness that is not a sum of squares they take a bootstrap, some seconds.
    effects : names or Effects
        Added to those that the campaign declares; NAME takes the first form that fits, NAME:FORM another.
    plugins : list of FILE.py:attribute
        Things of your own, whose code is run.
    window : (begin, end), s
        What is seen of every record.
    bounds : mapping of parameter to (low, high), SI
        Bounds of the search; a parameter with bounds is free.
    fix : mapping of parameter to value, SI
        Parameters that are not searched.
    plant : name or Plant
        The plant of tables; or a plant of your own that campaign.toml names.
    units : {"deg", "rad", "rpm"}
        In which angles and turning speeds are shown; None: as they were recorded.
    threads : int
        Among which candidates are shared; the result does not depend on it.

    Returns
    -------
    Identification
        It prints itself; `table`, `plot()`, `to_dict()`, `save(folder)`.

    Raises
    ------
    DataError
        For records that cannot be used.
    ModelError
        For an unknown effect, parameter or value.
    ArmidError
        For all else that cannot be used: an identifier, its options, a fitness, a budget.
    """
    from armid.estimation.data_checks import data_issues, roomy_space
    from armid.estimation.identify import identify as run
    from armid.problem.fitness import as_fitness, fitness_of_name

    if not isinstance(options or {}, Mapping):
        raise ArmidError(f"options is {quoted(options)}: name -> value is expected")
    window = PAPER_WINDOW if paper and window is None else window
    registry, read, composed = opened(campaign, effects, plugins, window, bounds, fix, plant, model, units)
    fitness = fitness or (PAPER_FITNESS if paper else USUAL_FITNESS)
    distance = (fitness_of_name(fitness, registry.fitness) if isinstance(fitness, str) else
                as_fitness(name_of(fitness, getattr(fitness, "__name__", "own")), fitness))  # fmt: skip
    by_default = PAPER_IDENTIFIER if paper else IDENTIFIER if distance.weigh is not None else WITHOUT_RESIDUALS
    searcher = identifier_of(identifier or by_default, registry).with_options(options or {})
    if budget is None:
        budget = PAPER_BUDGET if paper or identifier is not None else USUAL_BUDGET
    space = space or roomy_space(read, composed, bounds, fix)
    with angles_in(read.angle):
        issues = data_issues(read, composed, space)
    with warned_once(UserWarning):
        for issue in issues:
            warnings.warn(issue.sentence, stacklevel=2)
    with search_bar(progress is True) as shown:
        followed = progress if callable(progress) else shown
        identification = run(
            read, composed, space, distance, searcher, budget, seed, target, accuracy, followed, interval, threads
        )
    return replace(identification, issues=issues)


def identifier_of(given: Any, registry: Registry) -> Any:
    """Return the Identifier of a name, of a function or class, or of an algorithm of pymoo that was not used yet."""
    from armid.identifiers import as_identifier

    if isinstance(given, str):
        return registry.identifier_of(given)
    return as_identifier(name_of(given, getattr(given, "__name__", type(given).__name__)), given)


def examine(
    campaign: "CampaignLike", model: Model | None = None, space: "Space | None" = None,
    x: "Mapping[str, float] | ArrayLike | None" = None, noise: float | None = None, by: str = "volume",
    accuracy: str | None = None, progress: bool = False, *, where: str = "x", effects: Named = (),
    plugins: Iterable[str] = (), window: Window | None = None, bounds: Bounds | None = None,
    fix: Mapping[str, float] | None = None, plant: str | Plant | None = None, units: str | None = None,
) -> "Examination":  # fmt: skip
    """Say what the train records of a campaign tell about the parameters; `armid.examine("folder")` is enough.

    Parameters
    ----------
    campaign, model, space, effects, plugins, window, bounds, fix, plant, units
        See `identify`.
    x : mapping of name to value, SI; or the free parameters in order
        Where sensitivities are taken; None: at the least-squares estimate.
    noise : float
        White noise to assume for every record, in its unit, in place of what was measured.
    by : {"volume", "worst", "shrinkage"}
        How the next manoeuvre is chosen: by all parameters together, by the worst, or by the largest change.
    accuracy : {"standard", "fine"}
        Of the engine; None: as the noise of each record asks for.
    progress : bool
        Whether a line says what is done, in a terminal or a notebook.
    where : str
        What names x in a refusal.

    Returns
    -------
    Examination
        It prints itself; `table`, `plot()`, `to_dict()`, `save(folder)`.
    """
    from armid.estimation.data_checks import roomy_space
    from armid.estimation.examine import examine as run

    _, read, composed = opened(campaign, effects, plugins, window, bounds, fix, plant, model, units)
    box = space or roomy_space(read, composed, bounds, fix)
    at = free_values(box, x, where) if isinstance(x, Mapping) else x if x is None else np.asarray(x, dtype=np.float64)
    with status_line(progress) as show:
        return run(read, composed, box, at, noise, by, accuracy, show)


def free_values(space: "Space", given: Mapping[str, float], where: str) -> Array:
    """Return the values of the free parameters in order; a fixed one may be named, its value stays as it is fixed."""
    for name in given:
        if name not in space.names:
            raise ModelError(f"{where}: parameter '{name}' is not in the model: {nearest(name, space.names)}")
    missing = [name for name in space.free_names if name not in given]
    if missing:
        raise ModelError(f"{where}: parameter '{missing[0]}' is free and has no value there: one is expected")
    return np.array([given[name] for name in space.free_names])


def close_loop(
    model: "Model | CampaignLike", campaign: "CampaignLike | None" = None,
    candidates: Named | Mapping[str, Effect] | None = None, rng: np.random.Generator | None = None,
    bounds: Bounds | None = None, fixed: Mapping[str, float] | None = None, threads: int = 1,
    told: Callable[[str], None] | None = None, *, without: Named = (), curve: bool = True,
    progress: Path | bool | None = None, priors: Mapping[str, Any] | None = None, within: float | None = None,
    effects: Named = (), plugins: Iterable[str] = (), window: Window | None = None,
    fix: Mapping[str, float] | None = None, plant: str | Plant | None = None, units: str | None = None,
) -> "ClosedLoop":  # fmt: skip
    """Find what a declared model lacks on the train records; `armid.close_loop("folder")` is enough.

    Parameters
    ----------
    model : path, Campaign, or pandas DataFrames
        The campaign, whose declared model is taken; or a Model, with the campaign as second argument.
    campaign
        The campaign of a Model.
    candidates : names, Effects, or a mapping of name to Effect
        Effects to look for; None: all that apply.
    rng : Generator
        Not drawn from: searches start from evenly spread points, so that nothing is random.
    bounds, fixed : mappings of parameter to (low, high) and to value, SI
        Of the model or of a candidate.
    threads : int
        Among which simulations are shared; the result does not depend on it.
    told : callable
        Called with a sentence before each step that takes long.
    without : names
        Effects not to look for.
    curve : bool
        Whether the missing signal is recovered where no effect will do.
    progress : True or Path
        True shows a line that says what is done, in a terminal or a notebook. A path is the file in which estimates are
        kept as they are made: a second start goes on from them.
    priors : mapping
        What is known before the records, as [priors] of campaign.toml: effect -> probability, parameter -> (mean,
        standard deviation), SI.
    within : float
        A parameter is trusted whose 95 % interval is within this share of its value on either side; None: 0.05.
    effects, plugins, window, fix, plant, units
        As of `identify`; fix is another word for fixed.

    Returns
    -------
    ClosedLoop
        It prints itself; `table`, `plot()`, `to_dict()`, `save(folder)`.
    """
    from armid.loop import close_loop as run

    if isinstance(model, Model) != (campaign is not None):
        raise ArmidError("a Model and its campaign, or a campaign alone, is expected")
    declared = model if isinstance(model, Model) else None
    given = campaign if declared else model
    registry, read, composed = opened(given, effects, plugins, window, bounds, fix, plant, declared, units)
    known = registry.effects_for(read.plant)
    wanted = candidates if isinstance(candidates, Mapping) else effects_of(candidates, known, "candidates")
    left_out = effects_of(without, known, "without") if without else {}
    kept = {name: effect for name, effect in wanted.items() if name not in left_out}
    own = registry.own["effects"] if candidates is None else kept
    refusals = {name: [refusal_of(form, composed.plant) for form in kept[name].every_form]
                for name in kept if name in own}  # fmt: skip
    refused = {name: reasons[0] for name, reasons in refusals.items() if all(reasons)}
    if candidates is not None and refused.keys() == kept.keys() != set():
        raise ArmidError(
            f"candidates: {next(iter(refused.values()))}: an effect that can act on this plant is expected"
        )
    for name, reason in refused.items():
        warnings.warn(f"effect '{name}' is not looked for: {reason}", stacklevel=2)
    values = {**(fixed or {}), **(fix or {})}
    chances = {name: float(p) for name, p in (priors or {}).items() if not isinstance(p, Sequence)}
    known_too = with_known(read, {name: p for name, p in (priors or {}).items() if name not in chances})
    if within is not None and not 0.0 < within < 1.0:
        raise ArmidError(f"within is {within:g}: a share between 0 and 1 is expected, 0.05 for 5 %")
    share = {} if within is None else {"within": within}
    file = progress if isinstance(progress, Path) else None
    with status_line(progress is True) as shown, angles_in(known_too.angle):
        loop: ClosedLoop = run(composed, known_too, kept, bounds, values, threads, told or shown, curve,
                               file, chances, **share)  # fmt: skip
    return loop


def with_known(campaign: Campaign, given: Mapping[str, Sequence[float]]) -> Campaign:
    """Return a campaign with what is known of parameters of its plant; given: name -> (mean, deviation), SI."""
    names = [p.name for p in campaign.plant.parameters]
    for name, pair in given.items():
        if name not in names:
            raise ModelError(f"priors: parameter {quoted(name)} is not in the plant, {nearest(name, names)}")
        if len(pair) != 2 or not all(map(isfinite, pair)) or not pair[1] > 0.0:
            raise ArmidError(
                f"priors: '{name}' is {quoted(list(pair))}, (mean, standard deviation above 0) is expected"
            )
    known = {name: Known(mean=float(mean), sd=float(sd)) for name, (mean, sd) in given.items()}
    return replace(campaign, known={**campaign.known, **known})


def effects_of(given: Any, known: Mapping[str, Effect], where: str) -> Mapping[str, Effect]:
    """Return name -> Effect of names or Effects, None: all that are known; where: named in a refusal."""
    if given is None:
        return known
    effects = (e if isinstance(e, Effect) else chosen(e.strip(), known, f"{where}: effect") for e in each_of(given))
    return {effect.name: effect for effect in effects}


def simulate(
    model: "Model | CampaignLike", manoeuvre: Manoeuvre | None = None, population: "ArrayLike | None" = None,
    schedule: "Schedule | None" = None, threads: int = 1, states: bool = False, *,
    parameters: Mapping[str, float] | None = None, accuracy: str | None = None, effects: Named = (),
    plugins: Iterable[str] = (), window: Window | None = None, plant: str | Plant | None = None, **values: float,
) -> Any:  # fmt: skip
    """Simulate every record of a campaign, `armid.simulate("folder", p0=3.1e6)`; or a model through one manoeuvre.

    Parameters
    ----------
    model : path, Campaign, or pandas DataFrames
        The campaign; or a Model.
    manoeuvre, population, schedule, threads, states
        With a Model alone: what it is made to do, candidates (n_candidates, n_parameters) in SI, how finely time is
        cut, threads among which candidates are shared, and whether the states are kept.
    parameters : mapping of name to value, SI
        One that is not given takes the value that the campaign fixes, else its nominal one.
    accuracy : {"standard", "fine"}
        Of the engine; None: as the noise of each record asks for.
    effects, plugins, window, plant
        As of `identify`.
    **values : float, SI
        Further parameters, those whose name has no dot.

    Returns
    -------
    SimulatedCampaign or Simulation
        It prints itself; `table`, `plot()`, `to_dict()`, `save(folder)`.
    """
    from armid.engine import Schedule
    from armid.engine import simulate as run
    from armid.problem.simulated import SimulatedCampaign, candidate_of, simulated_table

    if isinstance(model, Model):
        if accuracy is not None or parameters is not None or values:
            raise ArmidError("accuracy or parameters are given with a Model: a schedule and a population are expected")
        if manoeuvre is None or population is None:
            raise ArmidError("a Model is given alone: a manoeuvre and a population are expected with it")
        return run(model, manoeuvre, population, schedule or Schedule(), threads, states)
    if any(given is not None for given in (manoeuvre, population, schedule)):
        raise ArmidError("a manoeuvre is given with a campaign: with a Model it is expected")
    _, read, composed = opened(model, effects, plugins, window, plant=plant)
    declared = replace(composed, plant=read.declared)
    asked = {**values, **(parameters or {})}
    candidate = candidate_of(declared, read, asked)
    with warned_once(UserWarning):
        tables = {r.file: simulated_table(r, declared, candidate, accuracy) for r in read.records}
    for name, value in asked.items():
        warn_if_far(declared.parameters[name], [value], f"{name} = {value:g}")
    return SimulatedCampaign(read, declared, candidate, tables)
