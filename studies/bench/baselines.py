"""What the engine is compared with: the declared arm in scipy, and in a plain scalar numba loop.

Written down a second time on purpose, as one would without the engine; it shares no code with it. Lowering with the
shell, -48 to 22 degrees.
"""

import math
from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Array = NDArray[np.float64]

I01, I23, I45, I6 = 2.0e-3, 4.0e-3, 1.2e-2, 64.0
I1, I2, I3, ETA1, ETA2 = 120.0, 60.0, 24.0, 0.97, 0.97
WEIGHT, ALPHA = 118.0 * 9.81 * 0.58, math.radians(5.0)
ARM, AREA, V0 = 0.060, 1.9635e-3, 0.40e-3
R, L_A, K, C = 0.40, 2.0e-3, 4.5e-5, 20.0
U, K_P, K_D, U_TH = 28.0, 280.0, 70.0, 0.5
THETA_A, THETA_C, THETA_D, DELTA_E = (math.radians(a) for a in (-55.0, -48.0, 22.0, 25.0))


@numba.njit(cache=True)
def slopes(theta, omega, current, p0, k, eta3, n, inertia, closed):
    """Right-hand side of Eqs 1-7 as one would write it."""
    if closed:
        u = K_P * (THETA_D - theta) - K_D * k * omega
        u -= min(max(u, -U_TH), U_TH)
        u = min(max(u, -U), U)
    else:
        u = U
    volume = V0 - AREA * ARM * (theta - THETA_A)
    balance = ARM * AREA * p0 * (V0 / volume) ** n
    flux = K * abs(current)
    motor = C * flux * current
    torque = 2 * motor * I1 * ETA1 * ETA2 * eta3 - balance + WEIGHT * math.cos(theta + ALPHA)
    return omega, torque / inertia, (u - R * current - C * flux * I1 * omega) / L_A


@numba.njit(cache=True)
def runge_kutta(theta, omega, current, h, p0, k, eta3, n, inertia, closed):
    """One classical step."""
    a1, b1, c1 = slopes(theta, omega, current, p0, k, eta3, n, inertia, closed)
    g = 0.5 * h
    a2, b2, c2 = slopes(theta + g * a1, omega + g * b1, current + g * c1, p0, k, eta3, n, inertia, closed)
    a3, b3, c3 = slopes(theta + g * a2, omega + g * b2, current + g * c2, p0, k, eta3, n, inertia, closed)
    a4, b4, c4 = slopes(theta + h * a3, omega + h * b3, current + h * c3, p0, k, eta3, n, inertia, closed)
    s = h / 6
    return (
        theta + s * (a1 + 2 * (a2 + a3) + a4),
        omega + s * (b1 + 2 * (b2 + b3) + b4),
        current + s * (c1 + 2 * (c2 + c3) + c4),
    )


@numba.njit(cache=True)
def total_inertia(eta3):
    """Eq 2."""
    return 2 * I01 * I1**2 * ETA1 * ETA2 * eta3 + I23 * I2**2 * ETA2 * eta3 + I45 * I3**2 * eta3 + I6


@numba.njit(cache=True)
def plain_loop(population, output, h):
    """Simulate candidate by candidate into output [rad/s], RK4 at the sample interval h [s], only E located.

    population: (n_candidates, 4), SI; output: (n_candidates, n_samples).
    """
    switch = THETA_D - DELTA_E
    for i in range(population.shape[0]):
        p0, k, eta3, n = population[i]
        inertia = total_inertia(eta3)
        theta, omega, current, closed = THETA_C, 0.0, 0.0, False
        output[i, 0] = 0.0
        for s in range(1, output.shape[1]):
            a, b, c = runge_kutta(theta, omega, current, h, p0, k, eta3, n, inertia, closed)
            if not closed and a >= switch:
                part = h * (switch - theta) / (a - theta)
                for _ in range(3):
                    a, b, c = runge_kutta(theta, omega, current, part, p0, k, eta3, n, inertia, False)
                    part += (switch - a) / b
                closed = True
                a, b, c = runge_kutta(a, b, c, h - part, p0, k, eta3, n, inertia, True)
            theta, omega, current = a, b, c
            output[i, s] = omega


def solve_with_scipy(candidate: Array, times: Array, tolerance: float) -> Array:
    """Return the speed of one candidate [rad/s], (n_samples,), from DOP853 with the event E.

    candidate: p0, k, eta3, n, SI; times: [s]; tolerance: relative and absolute.
    """
    p0, k, eta3, n = map(float, candidate)
    inertia = total_inertia.py_func(eta3)
    python_slopes = slopes.py_func

    def motion(closed: bool) -> Callable[[float, Array], Any]:
        return lambda _, y: python_slopes(y[0], y[1], y[2], p0, k, eta3, n, inertia, closed)

    def switch(_: float, y: Array) -> float:
        return float(THETA_D - DELTA_E - y[0])

    switch.terminal = True
    options: dict[str, Any] = {"method": "DOP853", "rtol": tolerance, "atol": tolerance, "dense_output": True}
    # A trial step may run far beyond the travel, where the gas has no volume; it is then rejected.
    with np.errstate(invalid="ignore"):
        first = solve_ivp(motion(False), (0.0, times[-1]), [THETA_C, 0.0, 0.0], events=switch, **options)
    assert first.sol is not None
    end = first.t[-1]
    speed = np.asarray(first.sol(times)[1])
    if end < times[-1]:
        second = solve_ivp(motion(True), (end, times[-1]), first.y[:, -1], **options)
        assert second.sol is not None
        speed = np.where(times <= end, speed, second.sol(times)[1])
    return speed
