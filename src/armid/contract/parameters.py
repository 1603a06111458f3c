"""The part of a contract that parameters keep, of a plant or an effect."""

from collections.abc import Iterable

import numpy as np

from armid.contract.finding import Finding
from armid.model import Parameter


def check_parameters(parameters: Iterable[Parameter]) -> list[Finding]:
    """Tell whether bounds are finite, other values lie between them, and units are named."""
    given = list(parameters)
    named = "the only parameter" if len(given) == 1 else f"all {len(given)} parameters"
    return [
        finding("bounds", [p.name for p in given if not np.isfinite([p.low, p.high]).all()],
                "bounds of {} are not finite", f"finite and ordered for {named}"),
        finding("values", [p.name for p in given if not inside(p)],
                "null, fixed or nominal value of {} is outside the bounds", f"inside the bounds for {named}"),
        finding("units", [p.name for p in given if not p.unit.strip()],
                "{} has no unit: '1' is expected for a plain number", f"named for {named}"),
    ]  # fmt: skip


def finding(name: str, wrong: list[str], says: str, otherwise: str) -> Finding:
    """Return a finding that fails where names are wrong, and tells them."""
    return Finding(name, not wrong, says.format(", ".join(wrong)) if wrong else otherwise)


def inside(p: Parameter) -> bool:
    """Tell whether every declared value lies between the bounds."""
    return all(p.low <= v <= p.high for v in (p.null, p.fixed, p.nominal) if v is not None)
