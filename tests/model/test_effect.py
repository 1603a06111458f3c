"""An effect declares itself without contradiction."""

import pytest

from armid.errors import ArmidError
from armid.model import EFFECTS, Effect, Guard, Parameter, State

LEVEL = Parameter("level", "effort", 0.0, 1.0, null=0.0)


def nothing():
    return 0.0


REFUSED = {
    "adds nothing": (lambda: Effect("e", (LEVEL,), {}), "effect 'e' adds to no port: at least one is expected"),
    "twice": (lambda: Effect("e", (LEVEL,), {"torque": nothing}, (State("level", "1", nothing, nothing),)),
              "effect 'e' declares 'level' twice: each name once is expected"),
    "guard twice": (lambda: Effect("e", (LEVEL,), {"torque": nothing}, guards=(Guard("level", nothing, latch=True),)),
                    "effect 'e' declares 'level' twice"),
    "reserved": (lambda: Effect("rate", (LEVEL,), {"torque": nothing}), "effect 'rate' cannot have this name: rate"),
    "name": (lambda: Effect("my effect", (LEVEL,), {"torque": nothing}), "effect 'my effect' is no usable name"),
    "state": (lambda: State("a-b", "1", nothing, nothing), "state 'a-b' is no usable name: letters, digits and single"),
    "guard": (lambda: Guard("", nothing), "guard '' is no usable name"),
}  # fmt: skip


@pytest.mark.parametrize(("make", "sentence"), REFUSED.values(), ids=REFUSED)
def test_a_contradiction_is_refused(make, sentence) -> None:
    with pytest.raises(ArmidError, match=sentence):
        make()


@pytest.mark.parametrize("effect", EFFECTS.values(), ids=EFFECTS)
def test_the_catalogue_is_documented(effect: Effect) -> None:
    assert effect.note
    assert effect.source
    assert all(p.note for p in effect.parameters)
    assert all(f.__doc__ for f in effect.adds.values())


def test_the_catalogue_goes_by_names() -> None:
    assert all(name == effect.name for name, effect in EFFECTS.items())
