"""The one list of undeclared effects, whatever the machine: families, each with published forms.

A form acts at one place: `command` (u comes late), `signal` (on u), `drive` (added to the effort E), `torque` (added at
the shaft), `play` (of an elastic coupling) or `sensor` (on an output, after the simulation). A form with its strength
at 0 does nothing, so that machines with and without it run side by side. Losses of E add up, each computed from E.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.signal import cont2discrete, lfilter

from machines.catalogue import Array, Machine

Sizes = Mapping[str, Any]
Library = tuple[tuple[str, ...], ...]
WIDTH = 0.005
"""Share of the typical speed over which the sign of a speed is smoothed; an eighth of it needs a step below 1 ms."""


@dataclass
class Here:
    """Hold what the machine does at one moment: arrays with a value for each record."""

    machine: Machine
    t: float
    q: Array
    v: Array
    u: Array
    effort: Array
    load: Array

    @property
    def sign(self) -> Array:
        width = WIDTH * self.machine.speed
        return self.v / np.sqrt(self.v**2 + width**2)


@dataclass(frozen=True)
class Form:
    """Declare a form of an effect.

    sizes: name -> (low, high, unit), drawn between; the first is the strength, which is 0 where the effect is not
    there. Units are SI, products of the machine's scales as in `SCALES`, or `command`, the largest command. A size with
    the unit "signed" is a share of the effort with a random sign.
    act: (sizes, states, here) -> value, with states (value, their rates); of a sensor: (sizes, values (n_steps,), step
    [s]) -> values. start, after: its states at the start and after each step.
    library: machine -> sets of effects of armid's library, each of which has this very form, () for none.
    fits: whether a machine may have it; a form that free parameters of its plant take over entirely does not fit.
    by_record: the strength grows from record to record, from 0 in the first.
    """

    family: str
    form: str
    place: str
    sizes: Mapping[str, tuple[float, float, str]]
    act: Callable[..., Any]
    source: str
    library: Callable[[Machine], Library] = lambda machine: ()
    n_states: int = 0
    start: Callable[..., list[Array]] | None = None
    after: Callable[..., list[Array]] | None = None
    fits: Callable[[Machine], bool] = field(default=lambda machine: True)
    by_record: bool = False

    @property
    def strength(self) -> str:
        return next(iter(self.sizes))


SCALES: Mapping[str, Callable[[Machine], float]] = {
    "s": lambda m: 1.0, "1": lambda m: 1.0, "1/s": lambda m: 1.0, "effort": lambda m: m.effort,
    "signed": lambda m: m.effort, "speed": lambda m: m.speed, "1/effort": lambda m: 1.0 / m.effort,
    "1/effort2": lambda m: 1.0 / m.effort**2, "effort/speed": lambda m: m.effort / m.speed,
    "speed*s": lambda m: m.speed, "1/speed/s": lambda m: 1.0 / m.speed,
    "angle": lambda m: 0.1 * m.speed,
}  # fmt: skip


def named(*names: str) -> Callable[[Machine], Library]:
    """Return effects of armid's library, any of which has the form."""
    return lambda machine: tuple((name,) for name in names)


def together(*names: str) -> Callable[[Machine], Library]:
    """Return effects of armid's library that have the form only together."""
    return lambda machine: (names,)


def of_sensor(end: str) -> Callable[[Machine], Library]:
    """Return the effect of armid's library at the sensor of the first output: `output_lag`, `angle_lag`."""
    return lambda machine: ((f"{machine.outputs[0].prefix}_{end}",),)


def mean_of_speed(machine: Machine) -> Library:
    """Return the effect of a mean over a time, which armid has at the sensor of a speed alone."""
    return of_sensor("average")(machine) if machine.outputs[0].state == 1 else ()


def late_whole(where: str) -> Callable[[Machine], Library]:
    """Return the effects of a dead time; a late sensor is a late drive where one output answers a recorded drive."""

    def library(machine: Machine) -> Library:
        drive, sensor = named("drive_delay", "controller_delay")(machine), of_sensor("delay")(machine)
        is_alike = not machine.controlled and len(machine.outputs) == 1
        first, second = (drive, sensor) if where == "drive" else (sensor, drive)
        return (*first, *second) if is_alike else first

    return library


def shows_bias(machine: Machine) -> bool:
    """Tell whether a bias of the sensor is more than another start."""
    return machine.name not in ("elastic_joint", "hydraulic_boom")


def keep(s: Sizes, z: Any, here: Here) -> Any:
    """Return nothing: a late command is made by the integration."""
    return 0.0


def lag(s: Sizes, z: Any, here: Here) -> Any:
    """Return u behind a first-order lag, dz/dt = (u - z)/T."""
    on = s["time"] > 0.0
    return np.where(on, z[0], here.u), [np.where(on, (here.u - z[0]) / np.maximum(s["time"], 1e-3), 0.0)]


def effort_lag(s: Sizes, z: Any, here: Here) -> Any:
    """Return z - E, z the effort behind a first-order lag."""
    on = s["time"] > 0.0
    return np.where(on, z[0] - here.effort, 0.0), [np.where(on, (here.effort - z[0]) / np.maximum(s["time"], 1e-3), 0)]


def second_lag(s: Sizes, z: Any, here: Here) -> Any:
    """Return u behind two poles, T^2 z'' + 2 d T z' + z = u."""
    on, time = s["time"] > 0.0, np.maximum(s["time"], 1e-3)
    return np.where(on, z[0], here.u), [z[1], (here.u - z[0] - 2.0 * s["damping"] * time * z[1]) / time**2]


def rate_limit(s: Sizes, z: Any, here: Here) -> Any:
    """Return u whose rate is limited to 1/slowness, followed with 3 ms."""
    on = s["slowness"] > 0.0
    most = 1.0 / np.maximum(s["slowness"], 1e-9)
    return np.where(on, z[0], here.u), [np.where(on, np.clip((here.u - z[0]) / 3e-3, -most, most), 0.0)]


def drive_play(s: Sizes, z: Any, here: Here) -> Any:
    """Return u behind a play: it moves when u has crossed the gap (Tao and Kokotovic 1995)."""
    return np.clip(z[0], here.u - s["gap"], here.u + s["gap"]), [np.zeros_like(here.u)]


def rational(s: Sizes, z: Any, here: Here) -> Any:
    x = s["sharpness"] * np.abs(here.effort)
    return -here.effort * x / (1.0 + x)


def droop(s: Sizes, z: Any, here: Here) -> Any:
    x = s["sharpness"] * here.effort**2
    return -here.effort * x / (1.0 + x)


def hard_limit(s: Sizes, z: Any, here: Here) -> Any:
    most = 1.0 / np.maximum(s["sharpness"], 1e-9)
    return np.clip(here.effort, -most, most) - here.effort


def tanh_limit(s: Sizes, z: Any, here: Here) -> Any:
    x = np.maximum(s["sharpness"], 1e-9)
    return np.tanh(x * here.effort) / x - here.effort


def threshold(s: Sizes, z: Any, here: Here) -> Any:
    """Return what a comparator takes: nothing comes below the zone, everything above it, over a tenth of the zone."""
    zone = np.maximum(s["zone"], 1e-12)
    passed = np.clip((np.abs(here.effort) - 0.95 * zone) / (0.1 * zone), 0.0, 1.0)
    return np.where(s["zone"] > 0.0, here.effort * (passed - 1.0), 0.0)


def one_sided(s: Sizes, z: Any, here: Here) -> Any:
    """Return what a valve with overlap on one edge alone takes (Merritt, section 5.2)."""
    return -np.clip(here.effort, 0.0, s["zone"])


def makkar(s: Sizes, z: Any, here: Here) -> Any:
    """Return -level (tanh(v/w) + excess (tanh(v/w) - tanh(v/fade))), differentiable."""
    sharp = np.tanh(here.v / (2.0 * WIDTH * here.machine.speed))
    return -s["level"] * (sharp + s["excess"] * (sharp - np.tanh(here.v / s["fade"])))


def root_law(s: Sizes, z: Any, here: Here) -> Any:
    """Return a friction with the root of the speed, that of thin lubrication films."""
    return -s["level"] * np.abs(here.v / here.machine.speed) ** 0.5 * here.sign


def lugre(s: Sizes, z: Any, here: Here) -> Any:
    width = WIDTH * here.machine.speed
    g = 1.0 + s["excess"] * np.exp(-((here.v / s["fade"]) ** 2))
    size = here.v**2 / np.sqrt(here.v**2 + width**2)
    return -s["level"] * z[0], [(here.v - size * z[0] / g) / s["way"]]


def dahl(s: Sizes, z: Any, here: Here) -> Any:
    return lugre({**s, "excess": 0.0, "fade": 1.0}, z, here)


def maxwell_slip(s: Sizes, z: Any, here: Here) -> Any:
    """Return three Maxwell-slip elements that break loose one after another (Al-Bender, Lampaert, Swevers 2005)."""
    rates = []
    for share, one in zip((0.5, 1.0, 2.0), z, strict=True):
        slipping = (np.abs(one) >= 1.0) & (np.sign(one) == np.sign(here.v))
        rates.append(np.where(slipping, 20.0 * (np.sign(one) - one), here.v / (share * s["way"])))
    return -s["level"] * (z[0] + z[1] + z[2]) / 3.0, rates


def carried(here: Here) -> Array:
    """Return the load of a gear, the mean of what drives it and of what it works against."""
    return 0.5 * (here.effort - here.load)


def load_friction(s: Sizes, z: Any, here: Here) -> Any:
    load, least = carried(here), 0.005 * here.machine.effort
    return -s["share"] * load**2 / np.sqrt(load**2 + least**2) * here.sign


def faded_load(s: Sizes, z: Any, here: Here) -> Any:
    """Return a friction with the load that fades with the speed (Wojewoda et al. 2008)."""
    return -s["share"] * np.abs(carried(here)) * np.exp(-np.abs(here.v) / s["fade"]) * here.sign


def two_harmonics(s: Sizes, z: Any, here: Here) -> Any:
    a = s["waves"] * here.q + s["phase"]
    return s["level"] * (np.sin(a) + s["second"] * np.sin(2.0 * a - s["phase"]))


def triangle(s: Sizes, z: Any, here: Here) -> Any:
    a = s["waves"] * here.q + s["phase"]
    return s["level"] * (2.0 / np.pi) * np.arcsin(0.98 * np.sin(a))


def heated_gain(s: Sizes, z: Any, here: Here) -> Any:
    """Return the effort that a warm magnet lacks; its warmth follows the square of the effort over 5 s."""
    warmth = (here.effort / here.machine.effort) ** 2
    return -s["loss"] * np.minimum(z[0], 1.0) * here.effort, [warmth - 0.2 * z[0]]


def late_sensor(s: Sizes, y: Array, h: float) -> Array:
    k = round(s["delay"] / h)
    return np.concatenate([np.full(k, y[0]), y[: y.size - k]])


def filtered(y: Array, h: float, numerator: list[float], denominator: list[float]) -> Array:
    """Return a signal behind a filter that has settled before the start; straight lines between the steps."""
    b, a, _ = cont2discrete((numerator, denominator), h, method="foh")
    return np.asarray(y[0] + lfilter(np.ravel(b), a, y - y[0]))


def first_order_sensor(s: Sizes, y: Array, h: float) -> Array:
    return filtered(y, h, [1.0], [s["time"], 1.0])


def second_order_sensor(s: Sizes, y: Array, h: float) -> Array:
    return filtered(y, h, [1.0], [s["time"] ** 2, 2.0 * s["damping"] * s["time"], 1.0])


def averaging_sensor(s: Sizes, y: Array, h: float) -> Array:
    k = max(round(s["time"] / h), 1)
    total = np.cumsum(np.concatenate([np.full(k, y[0]), y]))
    return (total[k:] - total[:-k]) / k


def sensor_play(s: Sizes, y: Array, h: float) -> Array:
    seen, now = np.empty_like(y), y[0]
    for i, value in enumerate(y.tolist()):
        now = min(max(now, value - s["gap"]), value + s["gap"])
        seen[i] = now
    return seen


def from_command(s: Sizes, here: Here) -> list[Array]:
    return [here.u, np.zeros_like(here.u)]


BOOK = "Armstrong-Helouvry, Dupont, Canudas de Wit 1994, doi:10.1016/0005-1098(94)90209-7"
CONTROL = "Astrom and Murray, Feedback Systems, chapter 9"
TAO = "Tao and Kokotovic 1994, IEEE Trans. Automatic Control 39(1)"
DOEBELIN = "Doebelin, Measurement Systems, chapter 3"
DRY = {"level": (0.03, 0.15, "effort")}
FADING = {**DRY, "excess": (0.3, 1.2, "1"), "fade": (0.03, 0.15, "speed")}
WAVES = {"waves": (20.0, 80.0, "1/speed/s"), "phase": (0.0, 6.28, "1")}
PART = {"sharpness": (0.2, 1.0, "1/effort")}
ZONE = {"zone": (0.03, 0.2, "effort")}
LATE = {"delay": (0.005, 0.08, "s")}
FORMS = (
    Form("dead_time", "drive", "command", LATE, keep, CONTROL, late_whole("drive")),
    Form("dead_time", "sensor", "sensor", LATE, late_sensor, DOEBELIN, late_whole("sensor")),
    Form("dead_time", "beating", "command", {**LATE, "period": (0.3, 2.0, "s")}, keep,
         "Nilsson, Bernhardsson, Wittenmark 1998, doi:10.1016/S0005-1098(97)00170-2"),
    Form("lag", "voltage", "signal", {"time": (0.005, 0.05, "s")}, lag, "Leonhard, Control of Electrical Drives",
         named("drive_lag"), 1, from_command, fits=lambda machine: machine.volts),
    Form("lag", "actuator", "drive", {"time": (0.02, 0.3, "s")}, effort_lag, "doi:10.1109/MRA.2012.2206474",
         named("drive_lag"), 1, lambda s, here: [here.effort], fits=lambda machine: not machine.volts),
    Form("lag", "second_order", "signal", {"time": (0.008, 0.06, "s"), "damping": (0.3, 0.8, "1")}, second_lag,
         "Merritt, Hydraulic Control Systems, chapter 7", n_states=2, start=from_command),
    Form("lag", "rate_limit", "signal", {"slowness": (0.05, 0.5, "s/command")}, rate_limit,
         "Astrom and Murray, Feedback Systems, chapter 11", n_states=1, start=from_command),
    Form("lag", "sensor", "sensor", {"time": (0.005, 0.05, "s")}, first_order_sensor, DOEBELIN, of_sensor("lag")),
    Form("lag", "sensor_second_order", "sensor", {"time": (0.004, 0.012, "s"), "damping": (0.4, 1.2, "1")},
         second_order_sensor, DOEBELIN, named("gyro_lag"), fits=lambda machine: machine.outputs[0].state == 1),
    Form("lag", "sensor_average", "sensor", {"time": (0.02, 0.15, "s")}, averaging_sensor,
         "Brown, Schneider, Mulligan 1992, doi:10.1109/41.161471", mean_of_speed),
    Form("saturation", "rational", "drive", PART, rational, "Krishnan, PM Synchronous and BLDC Motor Drives",
         named("drive_saturation")),
    Form("saturation", "droop", "drive", {"sharpness": (0.2, 1.5, "1/effort2")}, droop,
         "Hanselman, Brushless Permanent Magnet Motor Design, chapter 4", named("torque_constant_droop")),
    Form("saturation", "hard", "drive", {"sharpness": (1.5, 4.0, "1/effort")}, hard_limit, TAO,
         named("drive_saturation")),
    Form("saturation", "tanh", "drive", {"sharpness": (0.8, 2.5, "1/effort")}, tanh_limit,
         "Ljung, System Identification, section 5.2 (Wiener and Hammerstein)", named("drive_saturation")),
    Form("dead_zone", "subtracting", "drive", ZONE,
         lambda s, z, here: -np.clip(here.effort, -s["zone"], s["zone"]), TAO, named("dead_zone")),
    Form("dead_zone", "threshold", "drive", ZONE, threshold, "Horowitz and Hill, The Art of Electronics, section 4.3"),
    Form("dead_zone", "one_sided", "drive", ZONE, one_sided, "Merritt, Hydraulic Control Systems, section 5.2"),
    Form("dry_friction", "coulomb", "torque", DRY, lambda s, z, here: -s["level"] * here.sign, BOOK, named("coulomb")),
    Form("dry_friction", "stribeck", "torque", FADING,
         lambda s, z, here: -s["level"] * (1.0 + s["excess"] * np.exp(-((here.v / s["fade"]) ** 2))) * here.sign,
         BOOK, together("coulomb", "stribeck")),
    Form("dry_friction", "dahl", "torque", {**DRY, "way": (0.003, 0.03, "speed*s")}, dahl,
         "doi:10.1016/S0947-3580(98)70113-X", named("presliding"), 1),
    Form("dry_friction", "lugre", "torque", {**FADING, "way": (0.003, 0.03, "speed*s")}, lugre, "doi:10.1109/9.376053",
         named("presliding"), 1),
    Form("dry_friction", "hess_soom", "torque", FADING,
         lambda s, z, here: -s["level"] * (1.0 + s["excess"] / (1.0 + (here.v / s["fade"]) ** 2)) * here.sign,
         "Hess and Soom 1990, doi:10.1115/1.2920240",
         together("coulomb", "stribeck")),
    Form("dry_friction", "makkar", "torque", FADING, makkar, "Makkar et al. 2005, doi:10.1109/AIM.2005.1511048"),
    Form("dry_friction", "root", "torque", {"level": (0.1, 0.4, "effort")}, root_law, BOOK),
    Form("dry_friction", "maxwell_slip", "torque", {**DRY, "way": (0.003, 0.02, "speed*s")}, maxwell_slip,
         "doi:10.1109/TAC.2005.858676", n_states=3),
    Form("load_friction", "proportional", "torque", {"share": (0.1, 0.5, "1")}, load_friction, "arXiv:2410.08650",
         named("load_friction")),
    Form("load_friction", "quadratic", "torque", {"share": (0.2, 1.0, "1")},
         lambda s, z, here: -s["share"] * carried(here) ** 2 / here.machine.effort * here.sign,
         "Wojewoda et al. 2008, doi:10.1098/rsta.2007.2125"),
    Form("load_friction", "fading", "torque", {"share": (0.2, 0.8, "1"), "fade": (0.05, 0.3, "speed")}, faded_load,
         "Wojewoda et al. 2008, doi:10.1098/rsta.2007.2125"),
    Form("backlash", "coupling", "play", {"gap": (0.01, 0.05, "1")}, keep, TAO, named("backlash"),
         fits=lambda machine: machine.name == "elastic_joint"),
    Form("backlash", "drive_play", "signal", {"gap": (0.02, 0.15, "command")}, drive_play,
         "Tao and Kokotovic 1995, doi:10.1109/9.341778", n_states=1, start=lambda s, here: [here.u],
         after=lambda s, z, here: [drive_play(s, z, here)[0]]),
    Form("backlash", "sensor_play", "sensor", {"gap": (0.005, 0.05, "angle")}, sensor_play,
         "Nordin and Gutman 2002, doi:10.1016/S0005-1098(02)00047-X", fits=lambda m: m.outputs[0].state == 0),
    Form("cogging", "sine", "torque", {"level": (0.02, 0.15, "effort"), **WAVES},
         lambda s, z, here: s["level"] * np.sin(s["waves"] * here.q + s["phase"]),
         "Holtz and Springob 1996, IEEE Trans. Industrial Electronics 43(2)", named("torque_ripple", "cogging")),
    Form("cogging", "two_harmonics", "torque", {"level": (0.02, 0.1, "effort"), **WAVES, "second": (0.4, 1.0, "1")},
         two_harmonics, "Islam, Mir, Sebastian 2004, doi:10.1109/TIA.2004.827469", named("cogging")),
    Form("cogging", "triangle", "torque", {"level": (0.02, 0.15, "effort"), **WAVES}, triangle,
         "Hanselman, Brushless Permanent Magnet Motor Design, chapter 5"),
    Form("cogging", "with_drive", "drive", {"level": (0.05, 0.3, "1"), **WAVES},
         lambda s, z, here: s["level"] * here.effort * np.sin(s["waves"] * here.q + s["phase"]),
         "Jahns and Soong 1996, doi:10.1109/41.491355"),
    Form("asymmetry", "viscous", "torque", {"slope": (0.03, 0.2, "effort/speed")},
         lambda s, z, here: -s["slope"] * here.v * here.sign,
         "Janot, Gautier, Brunot 2019", named("asymmetric_viscous")),
    Form("asymmetry", "coulomb", "torque", {**DRY, "difference": (0.2, 0.7, "1")},
         lambda s, z, here: -s["level"] * (here.sign + s["difference"]),
         "Janot, Gautier, Brunot 2019", together("coulomb", "torque_offset")),
    Form("asymmetry", "gain", "drive", {"share": (0.05, 0.3, "1")},
         lambda s, z, here: -s["share"] * np.maximum(here.effort, 0.0),
         "Merritt, Hydraulic Control Systems, chapter 6 (cylinders with a rod)",
         together("drive_asymmetry", "drive_gain")),
    Form("offset", "constant", "torque", {"level": (0.02, 0.12, "signed")},
         lambda s, z, here: s["level"] + 0.0 * here.q,
         "Janot, Gautier, Brunot 2019", named("torque_offset")),
    Form("offset", "sensor", "sensor", {"level": (0.01, 0.05, "speed")}, lambda s, y, h: y + s["level"], DOEBELIN,
         lambda machine: (("gyro_bias",),) if machine.outputs[0].state == 1 else of_sensor("bias")(machine),
         fits=shows_bias),
    Form("offset", "wandering", "torque", {"level": (0.02, 0.12, "signed"), "period": (1.0, 6.0, "s")},
         lambda s, z, here: s["level"] * np.sin(2.0 * np.pi * here.t / s["period"]) + 0.0 * here.q, DOEBELIN),
    Form("offset", "warming_up", "torque", {"level": (0.03, 0.15, "signed"), "period": (0.5, 4.0, "s")},
         lambda s, z, here: s["level"] * (1.0 - np.exp(-here.t / s["period"])) + 0.0 * here.q, DOEBELIN),
    Form("drifted_gain", "between_records", "drive", {"loss": (0.1, 0.4, "1")},
         lambda s, z, here: -s["loss"] * here.effort, "doi:10.1115/1.4027506", by_record=True),
    Form("drifted_gain", "fading", "drive", {"loss": (0.1, 0.4, "1"), "period": (0.5, 4.0, "s")},
         lambda s, z, here: -s["loss"] * (1.0 - np.exp(-here.t / s["period"])) * here.effort,
         "Hughes and Drury, Electric Motors and Drives, chapter 3"),
    Form("drifted_gain", "heated", "drive", {"loss": (0.1, 0.5, "1")}, heated_gain, "IEC 60034-1", n_states=1),
    Form("drifted_gain", "with_speed", "drive", {"loss": (0.1, 0.4, "1")},
         lambda s, z, here: -s["loss"] * np.minimum(np.abs(here.v) / here.machine.speed, 1.0) * here.effort,
         "Hanselman, Brushless Permanent Magnet Motor Design, chapter 4"),
)  # fmt: skip
FAMILIES = tuple(dict.fromkeys(form.family for form in FORMS))
