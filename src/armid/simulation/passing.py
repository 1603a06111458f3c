"""Effects that a whole group of candidates leaves at their null are passed over: their equations are not evaluated.

A model that holds the whole library, one or two effects of it in use, then takes three times as long as the plant alone
instead of fifteen times (measured on the arm with 38 effects). The choice is one branch for all lanes and all samples
of a group. In a lane at the null an effect adds exactly 0 and its states rest, whatever the neighbours do.
"""

from collections.abc import Mapping

from armid.model import Model

# Below so many effects a model is what a user asked for, every effect in use; the choice would only cost.
FEWEST = 8
# What a node of an effect is where the effect is not used; a guard never crosses 0.
IDLE = {"term": 0.0, "rate": 0.0, "guard": 1.0}


def variable(key: str) -> str:
    """Return the local name of a key; the prefix keeps a plant's `g` or `h` apart from the loop's own names."""
    return f"v_{key.replace('.', '__')}"


def strengths_of(model: Model) -> dict[str, dict[str, float]]:
    """Return effect -> {key of a strength: its null} of the effects that can be passed over, none in a small model."""
    if len(model.effects) < FEWEST:
        return {}
    found = {e.name: {f"{e.name}__{p.name}": p.null for p in e.parameters if p.null is not None} for e in model.effects}
    return {name: strengths for name, strengths in found.items() if strengths}


def using(effect: str) -> str:
    """Return the local name of what is 1 in lanes that use an effect, else 0."""
    return f"using_{effect}"


def used(effect: str) -> str:
    """Return the local name of what tells whether any lane uses an effect."""
    return f"used_{effect}"


def use_lines(effect: str, nulls: Mapping[str, float]) -> list[str]:
    """Return the lines that tell which lanes use an effect: those with a strength that is not its null, or is NaN."""
    away = " + ".join(f"np.abs({variable(key)} - {null!r})" for key, null in nulls.items())
    return [
        f"{using(effect)} = 1.0 - select(1e-300, {away}, 1.0, 0.0)",
        f"{used(effect)} = any_above({using(effect)}, 0.5)",
    ]
