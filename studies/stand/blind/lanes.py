"""The declared arm for many parameter sets at once, side by side: what a fit of the declared model needs."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stand.arm import GRAVITY, Arm
from stand.manoeuvre import Manoeuvre
from stand.trajectory import SAMPLES_PER_SECOND

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
STEP = 1.0 / SAMPLES_PER_SECOND


@dataclass(frozen=True)
class Lanes:
    """Hold pairs of an arm and a manoeuvre, one lane each; every array is (n_lanes,), `arm` gives what all share."""

    arm: Arm
    p0: FloatArray
    damping: FloatArray
    n: FloatArray
    inertia: FloatArray
    drive: FloatArray
    moment: FloatArray
    start: FloatArray
    target: FloatArray
    supply: FloatArray

    def rates(self, state: FloatArray, closed: BoolArray) -> FloatArray:
        """Give d(angle, speed, current)/dt, (3, n_lanes), by paper Eqs 1-7; `closed` tells which lanes are past E."""
        arm, (angle, speed, current) = self.arm, state
        squeezed = arm.piston_area * arm.piston_lever * (angle - arm.travel[0]) / arm.gas_volume
        pressure = self.p0 * np.maximum(1.0 - squeezed, 1e-3) ** -self.n
        torque = self.drive * np.abs(current) * current - arm.piston_lever * arm.piston_area * pressure
        torque += self.moment * np.cos(angle + arm.gravity_angle)
        demand = arm.position_gain * (self.target - angle) - self.damping * speed
        asked = np.clip(np.abs(demand) - arm.threshold, 0.0, self.supply) * np.sign(demand)
        voltage = np.where(closed, asked, self.supply * np.sign(self.target - self.start))
        emf = arm.emf_constant * arm.excitation * arm.ratio_motor * np.abs(current) * speed
        return np.array((speed, torque / self.inertia, (voltage - arm.resistance * current - emf) / arm.inductance))

    def step(self, state: FloatArray, closed: BoolArray, length: FloatArray) -> FloatArray:
        """Take a step of Runge and Kutta's fourth order, of its own length [s] in each lane."""
        first = self.rates(state, closed)
        second = self.rates(state + 0.5 * length * first, closed)
        third = self.rates(state + 0.5 * length * second, closed)
        fourth = self.rates(state + length * third, closed)
        return np.asarray(state + length / 6.0 * (first + 2.0 * (second + third) + fourth))

    def distance(self, state: FloatArray) -> FloatArray:
        """Give the distance to the switch E [rad]."""
        return np.asarray(np.abs(self.target - state[0]) - self.arm.switch_distance)


def make_lanes(pairs: Sequence[tuple[Arm, Manoeuvre]]) -> Lanes:
    """Put pairs of an arm and a manoeuvre side by side; the arms may differ in p0, k, eta3 and n alone."""
    arms, strokes = zip(*pairs, strict=True)
    loads = [arm.load(stroke.shell) for arm, stroke in pairs]
    ratio = [2.0 * a.torque_constant * a.excitation * a.ratio_motor * a.eta1 * a.eta2 * a.eta3 for a in arms]
    return Lanes(
        arm=arms[0],
        p0=np.array([arm.p0 for arm in arms]),
        damping=np.array([arm.speed_gain * arm.k for arm in arms]),
        n=np.array([arm.n for arm in arms]),
        inertia=np.array([arm.inertia(stroke.shell) for arm, stroke in pairs]),
        drive=np.array(ratio),
        moment=np.array([load.mass * GRAVITY * load.lever for load in loads]),
        start=np.array([stroke.start for stroke in strokes]),
        target=np.array([stroke.target for stroke in strokes]),
        supply=np.array([stroke.supply_volt for stroke in strokes]),
    )


def declared_speeds(pairs: Sequence[tuple[Arm, Manoeuvre]], n_samples: int) -> FloatArray:
    """Simulate the declared arm, with no stops at the ends of its travel; speeds at 1 kHz, (n_lanes, n_samples).

    Steps of 1 ms, of which the one over the switch E is taken in two; good to 5e-4 rad/s at the worst sample and
    3e-5 rad/s rms, a hundredth of the noise.
    """
    lanes = make_lanes(pairs)
    state = np.array((lanes.start, np.zeros_like(lanes.start), np.zeros_like(lanes.start)))
    closed = lanes.distance(state) <= 0.0
    whole = np.full_like(lanes.start, STEP)
    speeds = np.zeros((n_samples, lanes.start.size))
    for sample in range(1, n_samples):
        after = lanes.step(state, closed, whole)
        crossed = ~closed & (lanes.distance(after) <= 0.0)
        if crossed.any():
            before = lanes.distance(state)
            share = np.where(crossed, before / np.where(crossed, before - lanes.distance(after), 1.0), 1.0)
            halfway = lanes.step(state, closed, share * whole)
            closed = closed | crossed
            after = lanes.step(halfway, closed, (1.0 - share) * whole)
        state = after
        speeds[sample] = state[1]
    return speeds.T
