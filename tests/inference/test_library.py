"""Names of the effects that may be missing."""

from armid.inference.candidates import EffectKey


def test_keys_and_what_they_own():
    key = EffectKey("flux_saturation", "atan", free_shape=True)
    assert (key.compiled, key.public, key.declared) == (
        "flux_saturation_atan", "flux_saturation", EffectKey("flux_saturation", "atan"),
    )  # fmt: skip
    assert key.owns("flux_saturation_atan.level")
    assert not key.owns("flux_saturation_atan2.level")
    assert EffectKey("error_of_R").public == "constant:R"
