"""Which candidates are compiled together."""

from collections.abc import Mapping

from armid.model import ArmidError, Effect, Model

# More than the library holds: a model that grew for ever would take for ever to compile.
BUNDLE = 60


def applies(model: Model, effect: Effect) -> bool:
    """Tell whether an effect can be added to a model."""
    try:
        return bool(model + effect)
    except ArmidError:
        return False


def bundled(declared: Model, effects: Mapping[str, Effect]) -> tuple[tuple[str, ...], ...]:
    """Return keys of candidates in bundles that compose without a circle.

    Those without states of their own come first, so that the most used bundles stay the fastest.
    """
    bundles: list[tuple[Model, list[str]]] = []
    for effect in sorted(effects.values(), key=lambda e: (len(e.states), e.name)):
        for i, (model, names) in enumerate(bundles):
            if len(names) < BUNDLE and applies(model, effect):
                bundles[i] = (model + effect, [*names, effect.name])
                break
        else:
            bundles.append((declared + effect, [effect.name]))
    return tuple(tuple(names) for _, names in bundles)
