"""The candidates: effects by their keys, which of them are compiled together, and test signals."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from armid.errors import ArmidError
from armid.model import Effect, Model, Parameter

# What the names of constants that are known roughly begin with, which are looked for as effects are.
ERROR_OF, CONSTANT = "error_of_", "constant:"
# Fewer candidates than these are compiled together.
FEWEST_IN_BUNDLES = 12
# What the names of test signals begin with.
PROBE = "probe_"


@dataclass(frozen=True, order=True)
class EffectKey:
    """Name an effect of a model that the loop fits.

    name: of the effect. form: word of a published form, "" for the first one. free_shape: the parameters that the
    effect's declaration fixes, such as the width over which a sign is smoothed, are fitted too.
    """

    name: str
    form: str = ""
    free_shape: bool = False

    @property
    def compiled(self) -> str:
        return f"{self.name}_{self.form}" if self.form else self.name

    @property
    def declared(self) -> "EffectKey":
        return replace(self, free_shape=False)

    @property
    def public(self) -> str:
        """Name in reports, whatever the form."""
        return self.name.replace(ERROR_OF, CONSTANT, 1) if self.name.startswith(ERROR_OF) else self.name

    def owns(self, parameter: str) -> bool:
        return parameter.startswith(f"{self.compiled}.")


Active = tuple[EffectKey, ...]


@dataclass(frozen=True)
class Double:
    """Say which parameter or constant of the declared model is the law of an effect; exactly: in the same form."""

    name: str
    exactly: bool


def declared_keys(active: Iterable[EffectKey]) -> set[EffectKey]:
    """Return the effects of a model, whether or not their shapes are free."""
    return {key.declared for key in active}


def constant_effects(rough: Mapping[str, float]) -> dict[str, Effect]:
    """Return an effect for each constant or parameter that is known roughly; rough: name -> relative deviation.

    The plant has to know them roughly, too (`Plant.known_roughly`).
    """
    return {
        f"{ERROR_OF}{name}": Effect(
            f"{ERROR_OF}{name}", (Parameter("error", "1", -half, half, null=0.0, note="relative error"),),
            {f"{name}_error": relative_error}, note=f"{name} is another than declared", source="[tolerances]",
        )
        for name, half in rough.items()
    }  # fmt: skip


def relative_error(error: float) -> float:
    """Relative error of a constant."""
    return error


def compiled(key: EffectKey, effect: Effect) -> Effect:
    return replace(effect, name=key.compiled, forms=())


def bundled(declared: Model, effects: Mapping[EffectKey, Effect]) -> tuple[Active, ...]:
    """Return keys of candidates in bundles that compose without a circle.

    First those without states and late signals of their own, whose model takes half of the time; then these and all
    others, whose model holds test signals too. Few are one bundle.
    """
    pairs = sorted(((key, compiled(key, effect)) for key, effect in effects.items()), key=lambda pair: pair[1].name)
    plain = [pair for pair in pairs if not (pair[1].states or pair[1].delays)]
    others = [pair for pair in pairs if pair not in plain]
    first = grouped(declared, (declared, ()), plain) if len(pairs) >= FEWEST_IN_BUNDLES else []
    rest = grouped(declared, first[0] if first else (declared, ()), others if first else pairs)
    return tuple(keys for _, keys in [*first, *rest])


def grouped(
    declared: Model, begun: tuple[Model, Active], pairs: Sequence[tuple[EffectKey, Effect]]
) -> list[tuple[Model, Active]]:
    """Return models that hold effects, the first what is begun too, as few as compose without a circle."""
    if not pairs:
        return []
    joint = joined(begun[0], *(effect for _, effect in pairs))
    if joint is not None:
        return [(joint, (*begun[1], *(key for key, _ in pairs)))]
    models: list[tuple[Model, Active]] = []
    for key, effect in pairs:
        for i, (model, held) in enumerate(models or [begun]):
            extended = joined(model, effect)
            if extended is not None:
                models[i : i + 1] = [(extended, (*held, key))]
                break
        else:
            models.append((declared + effect, (key,)))
    return models


def joined(model: Model, *effects: Effect) -> Model | None:
    """Return a model with effects, None where they cannot be composed."""
    try:
        return replace(model, effects=(*model.effects, *effects))
    except ArmidError:
        return None


def idle(parameter: Parameter) -> float:
    """Return where a parameter of an effect that is not in use rests."""
    known = [v for v in (parameter.null, parameter.fixed, parameter.nominal) if v is not None]
    return float(known[0] if known else 0.5 * (parameter.low + parameter.high))


def bump(time, size, centre, width):  # type: ignore[no-untyped-def]
    """Return a triangle of a height at a time [s], width to either side [s]."""
    return size * np.maximum(0.0, 1.0 - np.abs(time - centre) / width)


def bump_at(port: str) -> Effect:
    """Return the test signal as an effect at a port."""
    parameters = (
        Parameter("size", "1", -1.0, 1.0, null=0.0), Parameter("centre", "s", 0.0, 1.0),
        Parameter("width", "s", 1e-3, 1.0),
    )  # fmt: skip
    return Effect(f"{PROBE}{port}", parameters, {port: bump}, note="a triangle in time")
