"""Identifiers by name, and the composed ones: a global phase, then local ones from the best that was found."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from difflib import get_close_matches
from functools import partial
from inspect import signature
from itertools import accumulate
from sys import maxsize
from typing import Any

import numpy as np
from pymoo.core.algorithm import Algorithm

from armid.engine import golden_steps
from armid.errors import ArmidError, nearest_registered
from armid.identifiers.evolutionary import EVOLUTIONARY
from armid.identifiers.identifier import SMALLEST_SHARE, TRAITS, Identifier, Option, checked, options_in
from armid.identifiers.local import LEAST_SQUARES, NLOPT
from armid.identifiers.own import FOREIGN
from armid.identifiers.pso import PSO
from armid.identifiers.search import Dropped, SearchAlgorithm, SearchTask, Told, carry_out, takes_start
from armid.model import Array, Catalogue

PREFIX = "multistart:"
SHARE_OF_BUDGET = Option("of the budget", least=SMALLEST_SHARE, most=1.0)


def chain_of(phases: Sequence[Identifier]) -> Identifier:
    """Return the identifier that runs several one after another.

    Option `share`: of the budget for each phase but the last, "0.5" or "0.5:0.3"; without it each phase has half of
    what is left. Options of a phase carry its name, as in `pso.velocity_limit`.
    """
    for phase in phases[1:]:
        if phase.is_global and not phase.name.startswith(PREFIX):
            raise ArmidError(f"identifier '{phase.name}' is global, in a chain it is expected to be the first")
    names = [phase.name for phase in phases]
    flags: dict[str, Any] = {flag: any(getattr(phase, flag) for phase in phases) for flag in TRAITS}
    return Identifier("+".join(names), partial(built_chain, tuple(phases)), ", then ".join(names), **flags)


def built_chain(phases: tuple[Identifier, ...], budget: int, **options: Any) -> SearchAlgorithm:
    configured = of_phases(options, phases, ("share",), f"'{'+'.join(phase.name for phase in phases)}'")
    shares = shares_of(options.get("share"), len(phases))
    builds = [partial(phase.build, max(1, round(share * budget)))
              for phase, share in zip(configured, shares, strict=True)]  # fmt: skip
    for phase, build in zip(phases, builds, strict=True):
        if not takes_start(build()) and phase is not phases[0]:
            raise ArmidError(f"identifier '{phase.name}' takes no start x0, in a chain it is expected to be the first")
    ends = [*(round(end * budget) for end in accumulate(shares[:-1])), maxsize]
    return SearchAlgorithm(partial(search_in_turn, builds, ends), budget)


def search_in_turn(builds: Sequence[Callable[[], Algorithm]], ends: Sequence[int], task: SearchTask) -> None:
    """Run fresh phases one after another, each from the best so far until so many simulations are used in all.

    The last batch of a phase may be cut.
    """
    best, least, used = task.start, np.inf, 0

    def ask(X: Array, residuals: bool = False) -> Told:
        nonlocal best, least, used
        kept = X[: end - used]
        told = task.ask(kept, residuals)
        used += len(kept)
        if len(kept) and (lowest := float(told.F.min())) < least:
            best, least = kept[np.argmin(told.F)].copy(), lowest
        if used >= end:
            raise Dropped
        return told

    for build, end in zip(builds, ends, strict=True):
        if used < end:
            try:
                carry_out(build(), replace(task, start=best, ask=ask))
            except Dropped:
                # the run itself may have ended
                if used < end:
                    raise


def shares_of(given: Any, n_phases: int) -> list[float]:
    if given is None:
        shares = [0.5**phase for phase in range(1, n_phases)]
    else:
        parts = given.split(":") if isinstance(given, str) else given if isinstance(given, list | tuple) else [given]
        shares = [checked("share", as_number(part), float, SHARE_OF_BUDGET) for part in parts]
    if len(shares) != n_phases - 1 or sum(shares) >= 1.0:
        raise ArmidError(f"share is {given!r}, expected {n_phases - 1} shares of the budget with a sum below 1, "
                         "one for each phase but the last, such as 0.5 or 0.5:0.3")  # fmt: skip
    return [*shares, 1.0 - sum(shares)]


def as_number(part: Any) -> Any:
    try:
        return float(part) if isinstance(part, str) else part
    except ValueError:
        return part


def multistart_of(local: Identifier) -> Identifier:
    """Return the identifier that starts a local one, whose options carry its name, from points spread over the box."""
    if local.is_global:
        raise ArmidError(f"identifier '{local.name}' is global, {PREFIX} expects a local one")
    return Identifier(
        f"{PREFIX}{local.name}", partial(built_multistart, local), f"{local.name} from ever new starts", is_global=True,
        uses_gradient=local.uses_gradient, needs_residuals=local.needs_residuals,
    )  # fmt: skip


def built_multistart(local: Identifier, budget: int, **options: Any) -> SearchAlgorithm:
    (configured,) = of_phases(options, (local,), (), f"'{PREFIX}{local.name}'")
    build = partial(configured.build, budget)
    if not takes_start(build()):
        raise ArmidError(f"identifier '{local.name}' takes no start x0, {PREFIX} expects one that does")
    return SearchAlgorithm(partial(search_again, build), budget)


def search_again(build: Callable[[], Algorithm], task: SearchTask) -> None:
    """Run fresh searches from the task's start, then from ever new points."""
    cube, start = task.cube, task.start
    for point in spread(task.random, cube.n):
        carry_out(build(), replace(task, start=cube.candidates(point)[0] if start is None else start))
        start = None


def spread(random: np.random.Generator, n: int) -> Iterator[Array]:
    """Yield points that fill the unit cube ever more evenly: a Kronecker sequence from a random point, (n,) each."""
    steps, point = golden_steps(n), random.random(n)
    while True:
        yield point
        point = (point + steps) % 1.0


def of_phases(
    options: Mapping[str, Any], phases: Sequence[Identifier], own: Sequence[str], whose: str
) -> tuple[Identifier, ...]:
    """Return the phases with their options: NAME.OPTION belongs to each of that name; own: those of the whole."""
    # of a multistart the name of the local one
    names = [phase.name.rpartition(":")[2] for phase in phases]
    named: dict[str, dict[str, Any]] = {name: {} for name in names}
    for key, value in options.items():
        name, dot, option = key.partition(".")
        if dot and name in named:
            named[name][option] = value
        elif key not in own:
            of_phase = (f"{n}.{each}" for n, phase in zip(names, phases, strict=True) for each in options_of(phase))
            hint = [f"did you mean '{near}'?" for near in get_close_matches(key, [*own, *of_phase], n=1)]
            hint += [f"those of a phase carry its name, {', '.join(f'{name}.OPTION' for name in named)}"]
            raise ArmidError(f"{whose} has no option '{key}', {hint[0]}")
    return tuple(
        # a multistart passes options on by name
        phase.with_options(named[n] if phase.name == n else {f"{n}.{option}": v for option, v in named[n].items()})
        for phase, n in zip(phases, names, strict=True)
    )


def identifier_of(name: str, known: Mapping[str, Identifier]) -> Identifier:
    """Return the identifier of a name, of `multistart:LOCAL`, or of a chain `GLOBAL+LOCAL[+LOCAL]`.

    Parameters
    ----------
    name : str
        The name, composed or not.
    known : Mapping
        Name -> identifier, those that may stand in a name; a user's own among them.

    Returns
    -------
    Identifier

    Raises
    ------
    ArmidError
        With the nearest name for one that is not known, and for a composition that makes no sense.
    """
    if name in known:
        return known[name]
    parts = name.split("+")
    if len(parts) > 1:
        return chain_of([identifier_of(part, known) for part in parts])
    if name.startswith(PREFIX):
        local = name.removeprefix(PREFIX)
        if local.startswith(PREFIX):
            raise ArmidError(f"identifier '{local}' is global, {PREFIX} expects a local one")
        return multistart_of(identifier_of(local, known))
    raise ArmidError(f"identifier '{name}' is not known: {nearest_registered(name, known)}")


IDENTIFIERS = Catalogue[Identifier]({i.name: i for i in (PSO, *EVOLUTIONARY, *NLOPT, LEAST_SQUARES, *FOREIGN)})
"""Name -> identifier, in the order in which `armid list` shows them."""


def options_of(identifier: Identifier) -> dict[str, dict[str, Any]]:
    """Return option -> default, unit, meaning, of those that an identifier declares; a default of None is its own."""
    if identifier.algorithm is None:
        return {name: {"default": p.default, "unit": "", "meaning": ""}
                for name, p in signature(identifier.build).parameters.items() if p.default is not p.empty}  # fmt: skip
    declared = ((option.name, option.default, option.metadata["option"]) for option in options_in(identifier.algorithm))
    return {name: {"default": default, "unit": o.unit, "meaning": o.meaning} for name, default, o in declared}
