"""A campaign.toml whose keys have any value, or none: a campaign or one sentence."""

import tomllib

from hypothesis import given
from mutated import mutated, toml_of
from reading_whatever import ARM_CSV, ARM_TOML, AXIS_CSV, AXIS_TOML, many, read_whatever

ARM, AXIS = tomllib.loads(ARM_TOML), tomllib.loads(AXIS_TOML)


def test_the_writer_of_toml_is_right():
    assert tomllib.loads(toml_of(ARM).decode()) == ARM
    assert read_whatever(toml_of(ARM), ARM_CSV.encode()) is not None
    assert read_whatever(toml_of(AXIS), AXIS_CSV.encode()) is not None


@many(120)
@given(mutated(ARM))
def test_any_value_for_the_arm(table):
    read_whatever(toml_of(table), ARM_CSV.encode())


@many(120)
@given(mutated(AXIS))
def test_any_value_for_an_axis(table):
    read_whatever(toml_of(table), AXIS_CSV.encode())
