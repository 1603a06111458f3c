"""The late controller of the stand: a true delay, and a command held between samples."""

from functools import cache

import numpy as np
import numpy.typing as npt
import pytest

from stand.arm import Arm
from stand.effects import Effects
from stand.manoeuvre import KNOWN
from stand.motion import Motion
from stand.trajectory import Trajectory, simulate

FINE = 1e-4
"""Step of the plain integrator [s], a whole part of every delay here."""


@cache
def moved(name: str, told: tuple[tuple[str, float], ...] = ()) -> Trajectory:
    return simulate(Motion(Arm(), KNOWN[name], Effects(**dict(told))), 1.0, 1e-9)


def plainly_late(name: str, delay: float) -> npt.NDArray[np.float64]:
    """Integrate by the midpoint rule, with a plain list of the states gone by; speeds at 1 kHz [rad/s]."""
    motion = Motion(Arm(), KNOWN[name])
    back, target = round(delay / FINE), motion.manoeuvre.target
    gone = [np.array(list(motion.start.values()))] * (back + 1)
    closed = False
    for _ in range(round(1.0 / FINE)):
        now, late, next_late = gone[-1], gone[-1 - back], gone[-back]
        closed = closed or abs(target - late[0]) <= motion.arm.switch_distance
        half = now + 0.5 * FINE * np.array(motion.rates(now, closed, late))
        gone.append(now + FINE * np.array(motion.rates(half, closed, 0.5 * (late + next_late))))
    return np.array(gone)[back :: round(1e-3 / FINE), 1]


@pytest.mark.parametrize("delay", [0.002, 0.010])
@pytest.mark.parametrize(("name", "near"), [("lower", 4e-3), ("inside_E", 4e-4)])
def test_a_delay_agrees_with_a_plain_integrator_that_remembers(name: str, near: float, delay: float) -> None:
    """Allow for the switch of the plain one, which comes up to a step late."""
    found = moved(name, (("controller_delay", delay),)).gyro
    assert np.abs(found - plainly_late(name, delay)).max() < near
    assert np.abs(found - moved(name).gyro).max() > 10.0 * near


def test_a_delay_shifts_the_switch_and_nothing_before_it() -> None:
    plain, late = moved("lower"), moved("lower", (("controller_delay", 0.008),))
    assert plain.switch_s is not None
    assert late.switch_s == pytest.approx(plain.switch_s + 0.008, abs=1e-9)
    reached = int(plain.switch_s * 1000)
    assert np.abs(late.gyro - plain.gyro)[: reached + 1].max() < 1e-7


@pytest.mark.parametrize("name", ["controller_delay", "controller_period"])
def test_what_a_late_controller_does_vanishes_with_its_lateness(name: str) -> None:
    away = [np.abs(moved("raise", ((name, late),)).gyro - moved("raise").gyro).max() for late in (8e-3, 2e-3, 5e-4)]
    assert away[1] < 0.4 * away[0]
    assert away[2] < 0.4 * away[1]


def test_a_sampled_controller_closes_its_loop_at_the_next_sample() -> None:
    plain, held = moved("lower").switch_s, moved("lower", (("controller_period", 0.012),)).switch_s
    assert plain is not None
    assert held is not None
    assert plain <= held < plain + 0.012
    assert held / 0.012 == pytest.approx(round(held / 0.012))


def test_a_held_command_is_a_delay_of_half_a_period_nearly() -> None:
    held, late = moved("empty", (("controller_period", 0.004),)), moved("empty", (("controller_delay", 0.002),))
    alike = np.abs(held.gyro - late.gyro)[800:].max()
    assert alike < 0.5 * np.abs(late.gyro - moved("empty").gyro)[800:].max() + 1e-3
