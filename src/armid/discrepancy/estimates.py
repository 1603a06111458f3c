"""Parameters with their intervals, and whether they are to be trusted."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from armid.discrepancy.fit import Fit
from armid.discrepancy.library import Library
from armid.discrepancy.names import base
from armid.discrepancy.trace import Score
from armid.identifiability import information_at
from armid.model import Model

# An effect of the library that could bend a parameter by more than this share without being noticed is a doubt: on one
# stroke 2-7 %, on four different ones at most 0.6 % (measured on the arm).
BENT = 0.01
# Half of the 95 % interval may be this share of the value; correlations may be this strong; this near is on a bound.
WIDEST, STRONGEST, AT_BOUND = 0.05, 0.99, 1e-4


@dataclass(frozen=True)
class Estimate:
    """Hold one parameter.

    value, low, high: SI, the 95 % interval, None where it is fixed or not determined. trusted: False where a
    significant discrepancy remains, the bound holds it, the half width exceeds 5 % of the value, a correlation exceeds
    0.99, an effect could bend it unseen, or it was not identified at all; doubts: these reasons in words.
    """

    name: str
    value: float
    unit: str
    low: float | None
    high: float | None
    doubts: tuple[str, ...]

    @property
    def trusted(self) -> bool:
        """Whether nothing speaks against the value and its interval."""
        return not self.doubts


def unseen(declared: Fit, scores: Sequence[Score], library: Library) -> dict[str, list[tuple[float, str]]]:
    """Return, for each declared parameter, by how much which effect could bend it unseen, the strongest first."""
    return {
        name: sorted(((float(s.bends[i]), library.public(s.name)) for s in scores), reverse=True)
        for i, name in enumerate(declared.values)
    }


def estimates(
    fit: Fit, library: Library, discrepancy: bool, bends: Mapping[str, Sequence[tuple[float, str]]]
) -> tuple[Estimate, ...]:
    """Return the parameters of the declared model and of the effects added, under their public names.

    discrepancy: whether a significant one remains. bends: see `unseen`.
    """
    problem = fit.records
    space = problem.space
    information = information_at(problem.replays, space, fit.x)
    half = dict(zip(information.names, information.half_width, strict=True))
    strongest = strongest_correlations(information.correlation)
    wanted = {base(n) for n in fit.active}
    found = []
    for i, name in enumerate(space.names):
        owner = name.partition(".")[0]
        if owner in library.candidates and owner not in wanted:
            continue
        value, unit = float(fit.candidate[i]), space.units[i]
        public = public_name(name, library)
        if name not in half:
            found.append(Estimate(public, value, unit, None, None, ("it was not identified: its value is declared",)))
            continue
        j = space.free_names.index(name)
        width = float(half[name])
        doubts = tuple(doubts_of(value, width, float(fit.z[j]), strongest[j], discrepancy))
        doubts += bent_by([b for b in bends.get(name, ()) if b[1] not in {library.public(n) for n in fit.active}])
        low, high = (value - width, value + width) if np.isfinite(width) else (None, None)
        found.append(Estimate(public, value, unit, low, high, doubts))
    return tuple(found)


def bent_by(bends: Sequence[tuple[float, str]]) -> tuple[str, ...]:
    """Return the doubt about a parameter that an effect could bend unseen."""
    if not bends or bends[0][0] <= BENT:
        return ()
    return (f"{bends[0][1]} could bend it by {bends[0][0]:.1%} without being seen on these records",)


def strongest_correlations(correlation: np.ndarray) -> list[float]:
    """Return the strongest correlation of each parameter with another, 1 where it is not determined."""
    off = np.abs(correlation - np.diag(np.diag(correlation)))
    return [float(x) for x in np.nan_to_num(off, nan=1.0).max(axis=1, initial=0.0)] if len(off) else []


def doubts_of(value: float, half: float, share: float, correlation: float, discrepancy: bool) -> list[str]:
    """Return what speaks against a parameter, in words."""
    said = []
    if discrepancy:
        said.append("a significant discrepancy remains")
    if share <= AT_BOUND or share >= 1.0 - AT_BOUND:
        said.append("its bound holds it")
    if not half <= WIDEST * abs(value):
        said.append(f"half of its interval exceeds {WIDEST:.0%} of the value")
    if correlation > STRONGEST:
        said.append(f"it is correlated with another by more than {STRONGEST}")
    return said


def public_name(name: str, library: Library) -> str:
    """Return the name of a parameter as reports show it, whatever form its effect has."""
    owner, dot, own = name.partition(".")
    return f"{library.public(owner)}.{own}" if dot and owner in library.candidates else name


def public_model(fit: Fit, library: Library) -> Model:
    """Return the model of a fit, its effects under their public names."""
    return library.exact(fit.active)
