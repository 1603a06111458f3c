"""What the fixed text of a generated module is filled with."""

from dataclasses import dataclass
from functools import cached_property


@dataclass(frozen=True)
class Parts:
    """Hold the local names of one model in its generated module.

    parameters, constants: what a simulation is given, in order; fixed: quantities that do not move, computed once.
    states, inputs, latches: what moves, each in its order.
    latch_guards: the guard of each latch; guards: the kinks; guards_use_inputs: whether a guard may jump at a sample.
    wide: whether there are so many effects that what is rarely needed is compiled but once.
    """

    parameters: list[str]
    constants: list[str]
    fixed: list[str]
    states: list[str]
    inputs: list[str]
    latches: list[str]
    latch_guards: list[str]
    guards: list[str]
    guards_use_inputs: bool
    wide: bool = False

    @property
    def all_guards(self) -> list[str]:
        """Every guard, those of latches first."""
        return [*self.latch_guards, *self.guards]

    @property
    def times(self) -> list[str]:
        """Times at which the latches switched."""
        return [f"time_of_{k}" for k in self.latches]

    @property
    def carried(self) -> list[str]:
        """What goes from one step to the next."""
        return [*self.latches, *self.times, *self.states, *(f"ga_{g}" for g in self.all_guards)]

    @cached_property
    def lists(self) -> dict[str, str]:
        """Lists of names that several texts take, by placeholder."""
        x, u, guards = self.states, self.inputs, self.all_guards
        return {
            "latches": listed("", self.latches), "latches_n": listed("n_", self.latches),
            "new": listed("new_", self.latches), "times": listed("time_of_", self.latches),
            "fixed": listed("", self.fixed), "x": listed("", x), "x_n": listed("n_", x), "y": listed("y_", x),
            "k1s": listed("k1_", x), "fas": listed("fa_", x), "fbs": listed("fb_", x),
            **{v: listed(f"{v}_", x) for v in ("a", "b", "m", "d", "e")},
            **{v: target(f"{v}_", x) for v in ("k1", "k2", "k3", "k4", "fa", "fb")},
            **{v: listed(f"{v}_", u) for v in ("ua", "um", "ub", "us", "uz", "u0", "u1", "ur")},
            **{v: listed(f"{v}_", guards) for v in ("ga", "gb", "gm", "gd", "ge", "c")},
            "y_out": "y_recorded,", "y_out_value": "y_recorded",
        }  # fmt: skip


def listed(prefix: str, names: list[str]) -> str:
    """Return `prefix_a, prefix_b, ` with a comma behind each name."""
    return "".join(f"{prefix}{n}, " for n in names)


def target(prefix: str, names: list[str]) -> str:
    """Return the left side of a tuple assignment."""
    return listed(prefix, names).rstrip() if names else "_"


def block(lines: list[str], indent: int) -> str:
    """Return lines one below the other, `pass` for none."""
    return ("\n" + " " * indent).join(lines) or "pass"


def each(names: list[str], line: str, indent: int) -> str:
    """Return one line for each name, `@` standing for it."""
    return block([line.replace("@", n) for n in names], indent)


def nested(function: str, prefix: str, names: list[str]) -> str:
    """Return the maximum or minimum of prefixed names."""
    text = f"{prefix}{names[0]}"
    for n in names[1:]:
        text = f"{function}({text}, {prefix}{n})"
    return text
