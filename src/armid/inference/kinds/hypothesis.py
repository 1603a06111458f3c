"""A hypothesis: something that may be true of the machine or of its records, and is not in the declared model."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from armid.inference.library import Activation
from armid.inference.model import Fit
from armid.model import Array


@dataclass(frozen=True, order=True)
class Hypothesis:
    """Name one thing that the declared model may lack.

    kind: "effect" (an effect of the library), "record" (a fault of one record, or a parameter or constant that is
    another in it), "drift" (one that changes from record to record) or "unknown" (a signal without a form). name: the
    public name. form: which published form of the effect, or the variable on which an unknown signal depends.
    log_prior: log odds before the data. means: what the kind needs to apply the hypothesis. record: file of the record
    that is wrong, and the output whose sensor is, "" for the whole file; both "" for other kinds.
    """

    kind: str
    name: str
    form: str = ""
    log_prior: float = field(default=0.0, compare=False)
    means: Any = field(default=None, compare=False)
    record: tuple[str, str] = field(default=("", ""), compare=False)

    @property
    def public(self) -> tuple[str, str]:
        """Kind and name, whatever the form."""
        return self.kind, self.name

    @property
    def size_name(self) -> str:
        """Name of the unknown that is the size of a fault or drift."""
        return f"drift of {self.name}" if self.kind == "drift" else self.name


# A model in words: the hypotheses that hold in it.
Hypotheses = frozenset[Hypothesis]


def may_join(model: Hypotheses, hypothesis: Hypothesis, n_records: int) -> bool:
    """Tell whether a model may hold a hypothesis more.

    A record, or one sensor of it, is wrong in one way, and no more than half of the records are: what is wrong in most
    of them is the model. Several faults together could follow whatever it lacks.
    """
    if hypothesis.kind != "record":
        return all(h.public != hypothesis.public for h in model)
    file, output = hypothesis.record
    wrong = [h.record for h in model if h.kind == "record"]
    is_free = not any(f == file and (not o or not output or o == output) for f, o in wrong)
    return is_free and 2 * len({file, *(f for f, _ in wrong)}) <= max(n_records, 2)


@dataclass(frozen=True, eq=False)
class Proposal:
    """Hold what one hypothesis changes in a fit, to first order.

    columns: change of the whitened signal per full strength, (n_variants, n_samples). joint: whether all columns act
    together, each with a strength of its own; otherwise exactly one of them holds. one_sided: whether strengths are
    positive. scales: prior standard deviations of a strength, equally likely, (n_scales,). variants: log prior of each
    variant, (n_variants,). refit(fit, expansion, forecast, limit): the fit with the hypothesis, None where there is
    none; limit: the sum of squares that must be in reach. grid: of an effect, the strength and the shapes of each
    variant.
    """

    hypothesis: Hypothesis
    columns: Array
    scales: Array
    variants: Array
    refit: Callable[..., Fit | None]
    one_sided: bool = False
    joint: bool = False
    grid: Sequence[Activation] = ()


def log_prior(model: Hypotheses) -> float:
    """Return the log prior odds of a model; the sum does not depend on the order of a set."""
    return math.fsum(h.log_prior for h in model)


def words(hypotheses: Sequence[Hypothesis] | Hypotheses) -> str:
    """Return a model in words."""
    named = (f"something at {h.name}" if h.kind == "unknown" else h.name for h in hypotheses)
    return " + ".join(sorted(named)) or "nothing"
