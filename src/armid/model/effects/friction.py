"""Friction and other efforts on the shaft."""

from dataclasses import replace

import numpy as np

from armid.model.effect import SIGN_WIDTH, SIZE_WIDTH, Effect, State
from armid.model.parameter import Parameter


def coulomb_torque(omega, level, width):
    """Effort of Coulomb friction, -level sign(omega), the sign smoothed over width."""
    return -level * omega / np.sqrt(omega**2 + width**2)


def tanh_torque(omega, level, width):
    """Effort of Coulomb friction, -level tanh(omega/width)."""
    return -level * np.tanh(omega / width)


def arctan_torque(omega, level, width):
    """Effort of Coulomb friction, -level 2/pi arctan(omega/width)."""
    return -level * 2.0 / np.pi * np.arctan(omega / width)


DRY_LEVEL = Parameter("level", "effort", 0.0, 0.5, null=0.0, note="friction at any speed")
coulomb_tanh = Effect(
    name="coulomb", form="tanh", adds={"torque": tanh_torque}, parameters=(DRY_LEVEL, SIGN_WIDTH),
    note="friction of constant size against the motion", source="doi:10.1016/j.triboint.2005.11.014",
)  # fmt: skip
coulomb_arctan = replace(
    coulomb_tanh, form="arctan", adds={"torque": arctan_torque},
    source="doi:10.1002/(SICI)1096-9845(199705)26:5<541::AID-EQE660>3.0.CO;2-W",
)  # fmt: skip
coulomb = Effect(
    name="coulomb", form="root", forms=(coulomb_tanh, coulomb_arctan), adds={"torque": coulomb_torque},
    parameters=(DRY_LEVEL, SIGN_WIDTH),
    note="friction of constant size against the motion", source="doi:10.1016/0005-1098(94)90209-7",
)  # fmt: skip


EXCESS = Parameter("level", "effort", 0.0, 0.5, null=0.0, note="excess of friction at rest over friction in motion")


def stribeck_torque(omega, level, fade, exponent, width):
    """Effort of the excess, -level exp(-abs(omega/fade)^exponent) sign(omega), the sign smoothed over width.

    The excess alone (Stribeck 1902): it composes with `coulomb`, which is the friction that stays. Published exponents
    reach from 1/2 (Bo and Pavelescu 1982) over 1 (Tustin 1947) to 2 (Armstrong-Helouvry).
    """
    return -level * np.exp(-(((omega / fade) ** 2) ** (0.5 * exponent))) * omega / np.sqrt(omega**2 + width**2)


def hess_soom_torque(omega, level, fade, width):
    """Effort of the excess, -level / (1 + (omega/fade)^2) sign(omega), the sign smoothed over width."""
    return -level / (1 + (omega / fade) ** 2) * omega / np.sqrt(omega**2 + width**2)


hess_soom = Effect(
    name="stribeck", form="hess_soom", adds={"torque": hess_soom_torque},
    parameters=(
        EXCESS,
        Parameter("fade", "speed", 0.02, 0.5, nominal=0.08, note="speed at which half of the excess has faded"),
        SIGN_WIDTH,
    ),
    note="friction that is higher at low speed, and fades slowly", source="Hess, Soom 1990, doi:10.1115/1.2920240",
)  # fmt: skip
stribeck = Effect(
    name="stribeck", form="exponential", forms=(hess_soom,), adds={"torque": stribeck_torque},
    parameters=(
        EXCESS,
        Parameter("fade", "speed", 0.02, 0.5, nominal=0.08, note="speed at which the excess has faded to 1/e"),
        Parameter("exponent", "1", 0.5, 2.0, fixed=2.0, note="power of the speed in the exponential"),
        SIGN_WIDTH,
    ),
    note="friction that is higher at low speed", source="doi:10.1016/0005-1098(94)90209-7",
)  # fmt: skip


def viscous_torque(omega, slope):
    """Effort of viscous friction, -slope omega."""
    return -slope * omega


viscous = Effect(
    name="viscous", adds={"torque": viscous_torque},
    parameters=(Parameter("slope", "effort/speed", 0.0, 0.5, null=0.0, note="friction per speed"),),
    note="friction in proportion to speed", source="doi:10.1016/0005-1098(94)90209-7",
)  # fmt: skip


def asymmetric_viscous_torque(omega, slope, width):
    """Effort of the difference, -slope abs(omega): slopes are b + slope forwards, b - slope backwards; abs smoothed.

    `torque_offset` is the Coulomb half of such a difference.
    """
    return -slope * omega**2 / np.sqrt(omega**2 + width**2)


asymmetric_viscous = Effect(
    name="asymmetric_viscous", adds={"torque": asymmetric_viscous_torque},
    parameters=(
        Parameter("slope", "effort/speed", -0.3, 0.3, null=0.0, note="half the difference of the two slopes"),
        SIZE_WIDTH,
    ),
    note="viscous friction that differs between the directions",
    source="Janot, Gautier, Brunot 2019, Nonlinear System Identification Benchmarks",
)  # fmt: skip


def drag_torque(omega, c):
    """Effort of drag, -c omega abs(omega)."""
    return -c * omega * np.abs(omega)


quadratic_drag = Effect(
    name="quadratic_drag", adds={"torque": drag_torque},
    parameters=(Parameter("c", "effort/speed^2", 0.0, 0.5, null=0.0, note="drag per square of speed"),),
    note="drag in proportion to the square of speed", source="White, Fluid Mechanics, chapter 7 (drag of bodies)",
)  # fmt: skip


def load_friction_torque(omega, drive_effort, share, width, least, load_effort=0.0):
    """Effort of the friction, -share abs(load) sign(omega), load = (drive - load)/2; abs and sign smoothed.

    A gear carries the mean of what the drive puts in and what it works against; a plant without `load_effort` carries
    what the drive puts in, by half. The coefficient of the source is half of `share`.
    """
    load = 0.5 * (drive_effort - load_effort)
    return -share * load**2 / np.sqrt(load**2 + least**2) * omega / np.sqrt(omega**2 + width**2)


load_friction = Effect(
    name="load_friction", adds={"torque": load_friction_torque},
    parameters=(
        Parameter("share", "1", 0.0, 1.0, null=0.0, note="friction per load"),
        SIGN_WIDTH,
        Parameter("least", "effort", 0.0005, 0.05, fixed=0.005, note="load over which its size is smoothed"),
    ),
    note="friction in proportion to the load of the gear", source="arXiv:2410.08650",
)  # fmt: skip


def presliding_torque(level, share):
    """Effort of the friction, -level share: Coulomb friction with hysteresis instead of a jump (Dahl 1968)."""
    return -level * share


def share_rate(omega, share, way, width):
    """Rate of the share of the full friction [1/s], (omega - abs(omega) share) / way; abs smoothed over width."""
    return (omega - omega**2 / np.sqrt(omega**2 + width**2) * share) / way


def full_share(omega, width):
    """Return sign(omega), smoothed: what moves at the start has done so for longer than the way; at rest 0."""
    return omega / np.sqrt(omega**2 + width**2)


dahl = Effect(
    name="presliding", form="dahl", adds={"torque": presliding_torque},
    states=(State("share", "1", share_rate, full_share),),
    parameters=(
        Parameter("level", "effort", 0.0, 0.5, null=0.0, note="friction after the way"),
        Parameter("way", "speed*s", 0.001, 0.1, nominal=0.01, note="over which friction builds up to 63 %"),
        SIZE_WIDTH,
    ),
    note="friction that builds up after each reversal", source="doi:10.1016/S0947-3580(98)70113-X",
)  # fmt: skip


def bristle_torque(omega, level, way, excess, fade, damping, share, width):
    """Effort of the bristles, -level (z + damping dz/dt), z their deflection over that of sliding at speed."""
    return -level * (share + damping * bristle_rate(omega, way, excess, fade, share, width))


def bristle_rate(omega, way, excess, fade, share, width):
    """Rate of the deflection [1/s], (omega - abs(omega) z / g) / way, g = 1 + excess exp(-(omega/fade)^2)."""
    g = 1 + excess * np.exp(-((omega / fade) ** 2))
    return (omega - omega**2 / np.sqrt(omega**2 + width**2) * share / g) / way


def full_bristles(omega, excess, fade, width):
    """Return g sign(omega): what moves at the start has done so for longer than the way."""
    return (1 + excess * np.exp(-((omega / fade) ** 2))) * omega / np.sqrt(omega**2 + width**2)


lugre = Effect(
    name="presliding", form="lugre", adds={"torque": bristle_torque},
    states=(State("share", "1", bristle_rate, full_bristles),),
    parameters=(
        Parameter("level", "effort", 0.0, 0.5, null=0.0, note="friction at speed"),
        Parameter("way", "speed*s", 0.001, 0.1, nominal=0.01, note="deflection at which the bristles slide at speed"),
        Parameter("excess", "1", 0.05, 2.0, nominal=0.5, note="friction at rest over that at speed, less 1"),
        Parameter("fade", "speed", 0.02, 0.5, nominal=0.08, note="speed at which the excess has faded to 1/e"),
        Parameter("damping", "s", 0.0, 0.02, fixed=0.0, note="of the bristles, over their stiffness"),
        SIZE_WIDTH,
    ),
    note="friction of bristles that build up and break away (LuGre)", source="doi:10.1109/9.376053",
)  # fmt: skip


def hysteresis_rate(omega, share, way, unloading, exponent, width):
    """Rate of the share z [1/s], (omega - abs(z)^n (unloading abs(omega) sign(z) + (1 - unloading) omega)) / way.

    abs(omega) sign(z) is abs(omega) z / abs(z); abs is smoothed over width, and over 1e-6 for z.
    """
    size = np.sqrt(share**2 + 1e-12)
    against = unloading * omega**2 / np.sqrt(omega**2 + width**2) * share / size
    return (omega - size**exponent * (against + (1 - unloading) * omega)) / way


bouc_wen = Effect(
    name="presliding", form="bouc_wen", adds={"torque": presliding_torque},
    states=(State("share", "1", hysteresis_rate, full_share),),
    parameters=(
        Parameter("level", "effort", 0.0, 0.5, null=0.0, note="friction after the way"),
        Parameter("way", "speed*s", 0.001, 0.1, nominal=0.01, note="level over the stiffness of the first motion"),
        Parameter("unloading", "1", 0.5, 1.0, nominal=0.5, note="beta over beta + gamma; 0.5: back on a straight line"),
        Parameter("exponent", "1", 1.0, 4.0, fixed=2.0, note="how sharply it turns from building up to sliding"),
        SIZE_WIDTH,
    ),
    note="friction with a hysteresis loop (Bouc and Wen)", source="doi:10.1061/JMCEA3.0002106",
)  # fmt: skip
# Dahl's stays the first: the loop names a form only where it is not the first.
presliding = replace(dahl, forms=(lugre, bouc_wen))


def seal_torque(omega, l, force, width):
    """Torque of the seals [N m], -force l sign(omega), the sign smoothed over width; l is the piston's lever [m]."""
    return -force * l * omega / np.sqrt(omega**2 + width**2)


seal_friction = Effect(
    name="seal_friction", adds={"torque": seal_torque},
    parameters=(Parameter("force", "N", 0.0, 2000.0, null=0.0, note="friction of the seals on the piston"), SIGN_WIDTH),
    note="friction of the piston's seals, through its lever", source="Merritt, Hydraulic Control Systems, Wiley 1967",
)  # fmt: skip


def offset_torque(level):
    """Effort that does not depend on the motion, +level.

    An unbalanced weight, an offset of the drive, unequal Coulomb friction in the two directions.
    """
    return level


torque_offset = Effect(
    name="torque_offset", adds={"torque": offset_torque},
    parameters=(Parameter("level", "effort", -0.2, 0.2, null=0.0, note="constant effort"),),
    note="constant effort on the shaft",
    source="Janot, Gautier, Brunot 2019, Nonlinear System Identification Benchmarks",
)  # fmt: skip


def ripple_torque(theta, sine, cosine, waves):
    """Effort of one harmonic, sine sin(waves theta) + cosine cos(waves theta).

    Cogging, pole pairs, teeth, an eccentric wheel, the pitch of a screw. A wave as long as the motion could
    be anything that depends on position: hence `waves` from 20.
    """
    return sine * np.sin(waves * theta) + cosine * np.cos(waves * theta)


torque_ripple = Effect(
    name="torque_ripple", adds={"torque": ripple_torque},
    parameters=(
        Parameter("sine", "effort", -0.2, 0.2, null=0.0, note="amplitude of the sine"),
        Parameter("cosine", "effort", -0.2, 0.2, null=0.0, note="amplitude of the cosine"),
        Parameter("waves", "1/speed/s", 20.0, 500.0, nominal=50.0, note="2 pi per period of position"),
    ),
    note="torque that repeats with position",
    source="Holtz and Springob 1996, IEEE Trans. Industrial Electronics 43(2)",
)  # fmt: skip


def cogging_torque(theta, sine, cosine, waves, second):
    """Effort of the magnets, wave(waves theta) + second wave(2 waves theta), wave(a) = sine sin a + cosine cos a.

    `waves` from 20, as in `torque_ripple`: a wave as long as the motion could stand for gravity.
    """
    a = waves * theta
    return sine * (np.sin(a) + second * np.sin(2 * a)) + cosine * (np.cos(a) + second * np.cos(2 * a))


cogging = Effect(
    name="cogging", adds={"torque": cogging_torque},
    parameters=(
        Parameter("sine", "effort", -0.2, 0.2, null=0.0, note="amplitude of the sine"),
        Parameter("cosine", "effort", -0.2, 0.2, null=0.0, note="amplitude of the cosine"),
        Parameter("waves", "1/speed/s", 20.0, 500.0, nominal=50.0, note="least common multiple of slots and poles"),
        Parameter("second", "1", -1.0, 1.0, fixed=0.0, note="second harmonic as a share of the first"),
    ),
    note="magnets pull the rotor toward the teeth, with and without current",
    source="Islam, Mir, Sebastian 2004, doi:10.1109/TIA.2004.827469",
)  # fmt: skip


def spring_torque(theta, stiffness):
    """Effort of the spring, -stiffness theta; with `torque_offset` it rests elsewhere than at 0."""
    return -stiffness * theta


position_spring = Effect(
    name="position_spring", adds={"torque": spring_torque},
    parameters=(Parameter("stiffness", "effort/speed/s", -0.5, 0.5, null=0.0, note="negative: it drives outwards"),),
    note="effort in proportion to position, such as cables", source="doi:10.1007/978-3-319-32552-1",
)  # fmt: skip

EFFECTS = (
    coulomb, stribeck, viscous, asymmetric_viscous, quadratic_drag, load_friction, presliding, seal_friction,
    torque_offset, torque_ripple, cogging, position_spring,
)  # fmt: skip
