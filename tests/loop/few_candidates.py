"""Few candidates, so that one model is compiled for all tests of the loop, and the strokes that they are tried on."""

from dataclasses import replace

from armid.model import EFFECTS

# coulomb and seal_friction leave the very same trace
CANDIDATES = {n: EFFECTS[n] for n in ("coulomb", "seal_friction", "supply_sag", "tilt", "viscous")}
TRUTH = {"p0": 3.2e6, "k": 0.9, "eta3": 0.6, "n": 1.2}
STROKES = (
    "--repeats", "1", "--duration", "1.0",
    "--manoeuvres", "lower,raise,short,empty,lower_low_voltage", "--holdout", "lower_low_voltage",
)  # fmt: skip
COMMON = ("--p0", "3.2e6", "--k", "0.9", "--eta3", "0.6", "--n", "1.2", *STROKES)


def garbage(record, rng):
    measured = rng.standard_normal(record.measured.shape)
    pieces = tuple(replace(p, measured=measured[p.start_index :][: len(p.measured)]) for p in record.pieces)
    return replace(record, measured=measured, rest=rng.standard_normal(record.rest.shape), pieces=pieces)
