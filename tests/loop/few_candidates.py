"""Few candidates, so that one model is compiled for all tests of the loop, and the strokes that they are tried on."""

from dataclasses import replace

from armid.model import EFFECTS

# coulomb and seal_friction leave the very same trace
CANDIDATES = {n: EFFECTS[n] for n in ("coulomb", "seal_friction", "supply_sag", "tilt", "viscous")}
TRUTH = {"p0": 3.2e6, "k": 0.9, "eta3": 0.6, "n": 1.2}
COMMON = (
    "--p0", "3.2e6", "--k", "0.9", "--eta3", "0.6", "--n", "1.2", "--repeats", "1", "--duration", "1.0",
    "--manoeuvres", "lower,raise,short,empty,lower_low_voltage", "--holdout", "lower_low_voltage",
)  # fmt: skip


def garbage(record, rng):
    measured, rest = rng.standard_normal(record.measured.shape), rng.standard_normal(record.rest.shape)
    return record.with_signals(lambda signal: replace(signal, measured=measured, rest=rest))
