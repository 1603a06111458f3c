"""What is true of a campaign, in the words of the loop: which names are right, alone or in the place of another."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

# Names of armid that say what a family of the eight machines is, in a form of their own. A name of the same physics is
# no wrong name, and no full answer either.
SAME_PHYSICS = {
    "dead_time": ("drive_delay", "controller_delay", "output_delay", "angle_delay", "position_delay", "gyro_delay"),
    "lag": ("drive_lag", "output_lag", "angle_lag", "position_lag", "gyro_lag", "tachometer_lag", "output_average"),
    "saturation": ("drive_saturation", "flux_saturation", "torque_constant_droop"),
    "dead_zone": ("dead_zone",),
    "dry_friction": ("coulomb", "stribeck", "presliding"),
    "load_friction": ("load_friction",),
    "backlash": ("backlash",),
    "cogging": ("cogging", "torque_ripple"),
    "asymmetry": ("asymmetric_viscous", "drive_asymmetry"),
    "offset": ("torque_offset", "gyro_bias", "position_bias", "angle_bias"),
    "drifted_gain": ("drive_gain", "winding_heating", "torque_constant_droop"),
}


@dataclass(frozen=True)
class Truth:
    """Hold what is true: of each planted effect the sets of names that are its very form, and names of its physics.

    An effect whose form the library lacks has no sets.
    """

    effects: tuple[tuple[tuple[frozenset[str], ...], frozenset[str]], ...]
    fault: Mapping[str, Any]
    parameters: Mapping[str, float]
    exact: bool

    def holds(self, name: str) -> bool:
        """Tell whether a name is one of a planted effect."""
        return any(name in names for sets, _ in self.effects for names in sets)

    def is_same_physics(self, name: str) -> bool:
        return any(name in names for _, names in self.effects)

    def share(self, name: str, chances: Mapping[str, float]) -> float:
        """Return how true a name is: of names that nobody can tell apart each has its part of the probability."""
        for sets, _ in self.effects:
            alike = {n for names in sets for n in names if len(names) == 1}
            if name in alike and len(alike) > 1:
                return chances[name] / sum(chances.get(n, 0.0) for n in alike)
        return float(self.holds(name))


def truth_of(entry: Mapping[str, Any], hidden: bool) -> Truth:
    """Read the truth of a campaign; hidden: its effects were taken out of the library."""
    effects = []
    for effect in entry["effects"]:
        sets = effect.get("library", [[effect["name"]]] if effect["listed"] else [])
        own = SAME_PHYSICS.get(effect.get("family", ""), ())
        effects.append((() if hidden else tuple(frozenset(names) for names in sets), frozenset(own)))
    is_exact = entry.get("exact", not any(entry.get("tolerances", {}).values()))
    return Truth(tuple(effects), entry["fault"], entry["parameters"], is_exact)


def all_found(truth: Truth, groups: Sequence[frozenset[str]], largest: int) -> bool:
    """Tell whether each planted effect is named, or stands in a group of at most so many names."""
    answer = [group for group in groups if len(group) <= largest]
    return all(any(all(any(n in g for g in answer) for n in names) for names in sets) for sets, _ in truth.effects)
