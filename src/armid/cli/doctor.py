"""`armid doctor`: whether armid works here."""

from collections.abc import Iterator
from importlib.metadata import requires, version
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import TYPE_CHECKING, Any

from armid.cli.check import tell_points
from armid.cli.options import command, examples
from armid.model import PLANTS, Manoeuvre, Model

if TYPE_CHECKING:
    from armid.contract.trials import ContractPoint

# The lowering of the paper's first row: parameters, and the speed [rad/s] at every 100th of 701 samples as scipy's
# DOP853 has it from the plain equations (armid.contract.trials.simulate_plainly). The engine has to come this near.
CANDIDATE = (3.2e6, 1.0, 0.62, 1.0)
TRAJECTORY = (0.0, 0.54620029, 1.03742497, 1.48415008, 1.90696082, 2.3045749, 2.13752181, 1.15457684)
N_SAMPLES, INTERVAL, TOLERANCE = 701, 1e-3, 2e-5
# Half widths of the 95 % interval within which the truth of the synthetic axis has to be found.
NEAR = 2.0


@command("doctor", short_help="Say whether armid works here.", epilog=examples("armid doctor"))
def doctor_command() -> None:
    """Say whether armid works here.

    Versions, the cache of compiled models, the compiler, one simulation against a stored trajectory, threads, one
    identification of synthetic records. Exit code 0 where all is well, 1 where something is not.
    """
    tell_points("armid doctor", points(), kind="doctor")


def points() -> "Iterator[ContractPoint]":
    """Yield each point when it is done; what fails is told with its reason, and the rest is still tried."""
    from armid.contract.trials import ContractPoint

    for name, work in POINTS.items():
        begin = perf_counter()
        try:
            passed, sentence = work()
        except Exception as error:
            # whatever is wrong here is what this command is there to tell
            passed, sentence = False, f"{type(error).__name__}: {error}"
        yield ContractPoint(name, passed, f"{sentence} ({perf_counter() - begin:.1f} s)")


def versions() -> tuple[bool, str]:
    from packaging.requirements import Requirement

    needed = [r for r in map(Requirement, requires("armid") or ()) if r.marker is None or r.marker.evaluate()]
    wrong = [f"{r.name} {version(r.name)} ({r.specifier} expected)" for r in needed
             if not r.specifier.contains(version(r.name), prereleases=True)]  # fmt: skip
    return not wrong, ", ".join(wrong) or f"armid {version('armid')}; {len(needed)} packages as they should be"


def cache() -> tuple[bool, str]:
    from armid.engine.cache import cache_folder, unusable

    folder = cache_folder()
    why = unusable(folder)
    return not why, f"{folder} cannot be used ({why})" if why else f"{folder} can be written"


def compiler() -> tuple[bool, str]:
    import numba

    return numba.njit(lambda x: 2.0 * x)(1.5) == 3.0, f"numba {numba.__version__} compiles"


def simulation() -> tuple[bool, str]:
    error = abs(simulated(1)[0, ::100] - TRAJECTORY).max()
    return bool(error <= TOLERANCE), f"within {error:.1g} rad/s of the stored trajectory, {TOLERANCE:g} is allowed"


def threads() -> tuple[bool, str]:
    import numpy as np
    from joblib import cpu_count

    same = np.array_equal(simulated(1), simulated(2))
    return same, f"{cpu_count()} processors; two threads give the same bits as one"


def simulated(n_threads: int) -> Any:
    import numpy as np

    from armid.engine import calibrate, simulate

    arm = PLANTS["shell_transfer_arm"]
    constants = {"theta_C": np.radians(-48.0), "theta_D": np.radians(22.0), "shell": 1.0, "U": 28.0}
    manoeuvre, model = Manoeuvre(INTERVAL, N_SAMPLES, constants), Model(arm)
    population = np.tile(CANDIDATE, (64, 1))
    schedule = calibrate(model, manoeuvre, population[:1]).schedule
    return simulate(model, manoeuvre, population, schedule, threads=n_threads).output


def identification() -> tuple[bool, str]:
    """Identify the synthetic axis of `armid new campaign`."""
    from armid.by_name import identify
    from armid.cli.new import INERTIA, campaign_text, synthetic_records
    from armid.record import write_campaign

    with TemporaryDirectory(prefix="armid-") as place:
        folder = write_campaign(f"{place}/axis", campaign_text("axis"), synthetic_records())
        found = identify(folder, effects=["viscous"], identifier="least_squares").to_dict()["parameters"]["inertia"]
    off = abs(found["value"] - INERTIA) / (found["high"] - found["value"])
    return off <= NEAR, f"inertia {found['value']:.5g} kg m2 (true: {INERTIA:g}), {off:.1f} half widths of its interval"


POINTS = {"versions": versions, "cache": cache, "compiler": compiler, "simulation": simulation, "threads": threads,
          "identification": identification}  # fmt: skip
