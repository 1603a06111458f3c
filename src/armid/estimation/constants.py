"""Constants that are known within tolerances: what they do to the records, and what they leave undetermined.

The whitened signal about an estimate is r = J dz + C c + noise, z the free parameters, c the relative errors of the
constants, whose prior is a normal distribution with their tolerance as standard deviation. A column C c with prior
variance t^2 adds t^2 C C^T to the covariance of the noise.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from armid.estimation.least_squares import LeastSquaresProblem
from armid.model import Array, Manoeuvre, Plant
from armid.problem.problem import Replay, signals_of, with_each
from armid.record import Record

# Relative step of the differences.
CONSTANT_STEP = 1e-4
# Columns whose cosine is within this of 1 are one; a column below this share of the longest moves nothing.
ONE, NO_RESPONSE = 1e-6, 1e-7
# Combinations of relative changes that move the signal by less than this share of what each alone does are not seen.
UNSEEN_SHARE = 1e-5
# Exponents within this of a whole number are written as whole.
WHOLE_CHANGE = 0.02
NAMED = "constant:"


@dataclass(frozen=True, eq=False)
class Product:
    """Constants that the records know only as one product.

    exponents: of each name, the first 1. tolerance: of the product, relative. slope: change of the weighted signal per
    relative change of the first member, (n_samples,).
    """

    names: tuple[str, ...]
    exponents: tuple[float, ...]
    tolerance: float
    slope: Array

    @property
    def public(self) -> str:
        """Name in reports, such as `constant:L_loaded*m_loaded`; `+` joins the members of a sum."""
        is_product = all(abs(abs(e) - 1.0) < WHOLE_CHANGE for e in self.exponents)
        signs = [("*" if e > 0.0 else "/") if is_product else "+" for e in self.exponents[1:]]
        return NAMED + self.names[0] + "".join(s + n for s, n in zip(signs, self.names[1:], strict=True))

    @property
    def column(self) -> Array:
        return self.tolerance * self.slope


def moved_record(record: Record, plant: Plant, shares: Mapping[str, float]) -> Record:
    if not shares:
        return record
    return record.with_pieces(lambda p: p.with_constants(moved_constants(p.manoeuvre, plant, shares)))


def moved_replays(replays: Sequence[Replay], shares: Mapping[str, float]) -> tuple[Replay, ...]:
    """Return replays with constants moved."""
    return with_each(replays, lambda r: replace(r, record=moved_record(r.record, r.model.plant, shares)))


def moved_constants(manoeuvre: Manoeuvre, plant: Plant, shares: Mapping[str, float]) -> dict[str, float]:
    """Return the constants that shares of their values are added to, SI."""
    given = {c.name: c.value for c in plant.constants} | dict(manoeuvre.constants)
    return {name: given[name] * (1.0 + share) for name, share in shares.items()}


def slopes_of_constants(records: LeastSquaresProblem, z: Array, names: Sequence[str]) -> Array:
    """Return the change of the weighted signal per relative change of each constant, (n_names, n_samples).

    By central differences; a constant whose change makes the simulation diverge has a column of 0.
    """
    n = len(names)
    if not n:
        return np.empty((0, len(records.measured)))
    moves = dict(zip(names, np.hstack([CONSTANT_STEP * np.eye(n), -CONSTANT_STEP * np.eye(n)]), strict=True))
    candidates = np.repeat(records.whole(z[np.newaxis]), 2 * n, axis=0)
    sides = records.weighted(signals_of(records.replays, candidates, moves))
    slopes = (sides[:n] - sides[n:]) / (2.0 * CONSTANT_STEP)
    return np.where(np.isfinite(slopes).all(axis=1, keepdims=True), slopes, 0.0)


def products(records: LeastSquaresProblem, z: Array, tolerances: Mapping[str, float]) -> tuple[Product, ...]:
    """Return the constants with a tolerance that the records see, those that act as one product together."""
    names = [name for name, tolerance in tolerances.items() if tolerance > 0.0]
    if not names:
        return ()
    slopes = slopes_of_constants(records, z, names)
    lengths = np.linalg.norm(slopes, axis=1)
    left, products = [i for i in range(len(names)) if lengths[i] > NO_RESPONSE * lengths.max()], []
    while left:
        first = left[0]
        cosines = {i: float(slopes[first] @ slopes[i]) / (lengths[first] * lengths[i]) for i in left}
        members = [i for i in left if abs(cosines[i]) > 1.0 - ONE]
        exponents = tuple(float(np.sign(cosines[i]) * lengths[i] / lengths[first]) for i in members)
        tolerance = float(np.linalg.norm([e * tolerances[names[i]] for e, i in zip(exponents, members, strict=True)]))
        products.append(Product(tuple(names[i] for i in members), exponents, tolerance, slopes[first]))
        left = [i for i in left if i not in members]
    return tuple(products)


def columns_of(products: Sequence[Product], n_samples: int) -> Array:
    return np.array([p.column for p in products]).reshape(len(products), n_samples).T


def common_factors(names: Sequence[str], slopes: Array, products: Sequence[Product]) -> tuple[str, ...]:
    """Return in words which parameters the records give only together with constants.

    Of each parameter the smallest set of constants and further parameters that makes up for a change of it.
    """
    if len(names) + len(products) < 2:
        return ()
    columns = np.column_stack([slopes, *(p.slope for p in products)])
    lengths = np.linalg.norm(columns, axis=0)
    labels = [*names, *(p.public.removeprefix(NAMED) for p in products)]
    seen = [i for i, length in enumerate(lengths) if length > NO_RESPONSE * lengths.max()]
    small: Array = np.asarray(np.linalg.qr(columns[:, seen] / lengths[seen], mode="r"))
    said: dict[frozenset[str], str] = {}
    for place, i in enumerate(seen):
        others = [k for k in range(len(seen)) if k != place]
        members = smallest_span(small, place, others) if i < len(names) else None
        if members is None:
            continue
        weights = np.linalg.lstsq(small[:, members], -small[:, place], rcond=None)[0]
        powers = {labels[i]: 1.0}
        powers |= {
            labels[seen[k]]: float(w * lengths[i] / lengths[seen[k]]) for k, w in zip(members, weights, strict=True)
        }
        text = f"these records give {', '.join(powers)} up to a common factor"
        if any(abs(e - 1.0) > WHOLE_CHANGE for e in powers.values()):
            changes = ", ".join(f"{label} {e:+.2g} %" for label, e in powers.items())
            text = f"these records do not tell a change of {changes}, made together"
        said.setdefault(frozenset(powers), text)
    return tuple(said.values())


def smallest_span(columns: Array, place: int, others: Sequence[int]) -> list[int] | None:
    """Return a smallest set of other columns in whose span one lies, None where it lies in none of them."""

    def spans(members: Sequence[int]) -> bool:
        chosen = columns[:, list(members)]
        rest = columns[:, place] - chosen @ np.linalg.lstsq(chosen, columns[:, place], rcond=None)[0]
        return float(np.linalg.norm(rest)) < UNSEEN_SHARE

    for size in (1, 2):
        for members in combinations(others, size):
            if spans(members):
                return list(members)
    if not spans(others):
        return None
    left = list(others)
    for member in others:
        rest = [k for k in left if k != member]
        left = rest if spans(rest) else left
    return left
