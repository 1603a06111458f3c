"""Which parameters are searched, between which bounds, and what the others are."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from armid.errors import ModelError, nearest
from armid.model import Array, Model
from armid.record import Override

# How much wider a range becomes that is a size to expect, where it may be too narrow.
WIDER = 8.0


@dataclass(frozen=True)
class Space:
    """Hold the box of the free parameters and the values of the fixed ones, SI.

    names, units, low, high, fixed: one entry for each parameter of the model, in its order; fixed is NaN where free.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    low: Array
    high: Array
    fixed: Array

    @property
    def free(self) -> NDArray[np.bool_]:
        """Which parameters are searched."""
        return np.isnan(self.fixed)

    @property
    def free_names(self) -> tuple[str, ...]:
        """Names of the searched parameters."""
        return tuple(n for n, f in zip(self.names, self.free, strict=True) if f)

    def complete(self, X: Array) -> Array:
        """Return whole candidates: X, shape (n_candidates, n_free), with the fixed values put in.

        >>> low, high, fixed = np.zeros(2), np.ones(2), np.array([np.nan, 0.5])
        >>> Space(("a", "b"), ("1", "1"), low, high, fixed).complete(np.array([[0.1], [0.2]]))
        array([[0.1, 0.5],
               [0.2, 0.5]])
        """
        whole = np.tile(self.fixed, (len(X), 1))
        whole[:, self.free] = X
        return whole

    def with_bounds(self, name: str, low: float, high: float) -> "Space":
        """Return the space with a parameter free between new bounds.

        Raises ModelError for an unknown name and for bounds that are no interval.
        """
        at = np.arange(len(self.names)) == self.index(name)
        if not (np.isfinite([low, high]).all() and low < high):
            raise ModelError(f"bounds of '{name}' are {low:g} and {high:g}: finite numbers, low < high, are expected")
        fixed = np.where(at, np.nan, self.fixed)
        return replace(self, low=np.where(at, low, self.low), high=np.where(at, high, self.high), fixed=fixed)

    def with_wider(self, names: Iterable[str]) -> "Space":
        """Return the space with ranges of some parameters eight times as wide; a range keeps its sign."""
        space = self
        for name in names:
            low, high = float(self.low[self.index(name)]), float(self.high[self.index(name)])
            space = space.with_bounds(name, low * WIDER ** -np.sign(low), high * WIDER ** np.sign(high))
        return space

    def of_one_sign(self, name: str, low: float, high: float) -> tuple[float, float]:
        """Return the part of an interval that has the sign of the range, where the range has one.

        >>> mass = Space(("mass",), ("kg",), np.array([1.0]), np.array([9.0]), np.array([np.nan]))
        >>> mass.of_one_sign("mass", -4.0, 30.0)
        (0.0, 30.0)
        """
        i = self.index(name)
        return (max(low, 0.0) if self.low[i] >= 0.0 else low), (min(high, 0.0) if self.high[i] <= 0.0 else high)

    def with_fixed(self, name: str, value: float) -> "Space":
        """Return the space with a parameter fixed.

        Raises ModelError for an unknown name and for a value that is not finite.
        """
        at = np.arange(len(self.names)) == self.index(name)
        if not np.isfinite(value):
            raise ModelError(f"'{name}' is fixed at {value}: a finite number is expected")
        return replace(self, fixed=np.where(at, value, self.fixed))

    def only(self, names: Collection[str]) -> "Space":
        """Return the space of some of the parameters, in the order that they have here."""
        kept = np.array([n in names for n in self.names], dtype=np.bool_)
        named = tuple(n for n in self.names if n in names)
        units = tuple(u for u, k in zip(self.units, kept, strict=True) if k)
        return Space(named, units, self.low[kept], self.high[kept], self.fixed[kept])

    def index(self, name: str) -> int:
        """Return the place of a parameter; refuse an unknown name with ModelError."""
        if name not in self.names:
            raise ModelError(f"parameter '{name}' is not in the model: {nearest(name, self.names)}")
        return self.names.index(name)


def space_of(
    model: Model,
    overrides: Mapping[str, Override] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    fixed: Mapping[str, float] | None = None,
) -> Space:
    """Return the space of a model: declared bounds, then a campaign's overrides, then the caller's bounds and values.

    Parameters
    ----------
    model : Model
        Whose parameters these are.
    overrides : Mapping
        Name -> what a campaign says of it; of an effect that is not in the model it is passed over.
    bounds, fixed : Mapping
        Name -> (low, high), and value, SI.

    Returns
    -------
    Space

    Raises
    ------
    ModelError
        For a name that the model does not have, and for a parameter both bounded and fixed.
    """
    declared = [(p.low, p.high, np.nan if p.fixed is None else p.fixed) for p in model.parameters.values()]
    units = tuple(p.unit for p in model.parameters.values())
    columns = np.ascontiguousarray(np.array(declared, dtype=np.float64).reshape(-1, 3).T)
    space = Space(tuple(model.parameters), units, *columns)
    for name, override in (overrides or {}).items():
        if name not in space.names:
            continue
        i = space.index(name)
        if override.low is not None or override.high is not None:
            low = space.low[i] if override.low is None else override.low
            space = space.with_bounds(name, low, space.high[i] if override.high is None else override.high)
        if override.fixed is not None:
            space = space.with_fixed(name, override.fixed)
    for name in (*(bounds or {}), *(fixed or {})):
        if name in model.constants and name not in model.parameters:
            raise ModelError(f"'{name}' is a constant of {model.plant.name} and not a parameter: its value is "
                             "expected under [constants] of the campaign")  # fmt: skip
    for name, (low, high) in (bounds or {}).items():
        if name in (fixed or {}):
            raise ModelError(f"parameter '{name}' is given both bounds and a fixed value: one of them is expected")
        space = space.with_bounds(name, low, high)
    for name, value in (fixed or {}).items():
        space = space.with_fixed(name, value)
    return space
