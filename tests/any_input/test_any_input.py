"""Whatever the files hold, reading ends in a campaign or in an ArmidError, never in another exception."""

import tomllib

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from mutated import mutated, toml_of
from reading_whatever import ARM_CSV, ARM_TOML, AXIS_CSV, AXIS_TOML, edited, edits, many, read_whatever

ARM, AXIS = tomllib.loads(ARM_TOML), tomllib.loads(AXIS_TOML)


def test_the_originals_read_also_as_they_are_written_here():
    assert tomllib.loads(toml_of(ARM).decode()) == ARM
    for toml, csv in ((ARM_TOML.encode(), ARM_CSV), (toml_of(ARM), ARM_CSV), (toml_of(AXIS), AXIS_CSV)):
        assert read_whatever(toml, csv.encode()) is not None


@many(120)
@given(mutated(ARM))
def test_any_value_for_the_arm(table):
    read_whatever(toml_of(table), ARM_CSV.encode())


@many(120)
@given(mutated(AXIS))
def test_any_value_for_an_axis(table):
    read_whatever(toml_of(table), AXIS_CSV.encode())


@many(120)
@given(edits, edits)
def test_edited_arm(toml, csv):
    read_whatever(edited(ARM_TOML, toml), edited(ARM_CSV, csv))


@many(120)
@given(edits, edits)
def test_edited_axis(toml, csv):
    read_whatever(edited(AXIS_TOML, toml), edited(AXIS_CSV, csv))


@many(120)
@given(edits)
def test_edited_numbers(csv):
    read_whatever(AXIS_TOML.encode(), edited(AXIS_CSV, csv))


@many(120)
@given(edits)
def test_edited_declarations(toml):
    read_whatever(edited(ARM_TOML, toml), ARM_CSV.encode())


@many(120)
@given(st.lists(st.tuples(st.floats(), st.floats(), st.floats(), st.floats()), min_size=15, max_size=40), st.booleans())
def test_any_numbers(rows, sort):
    ordered = sorted(rows) if sort else rows
    text = "time_s,angular_velocity_rad_s,drive_V,angle_deg\n" + "".join(",".join(map(repr, r)) + "\n" for r in ordered)
    read_whatever(AXIS_TOML.replace("restart_s = 0.03", "").encode(), text.encode())


@many(120)
@given(st.lists(st.integers(1, 10**12), min_size=19, max_size=60), st.sampled_from([1e-12, 1e-3, 1e17]),
       st.sampled_from([1e30, 1.0, 1e-20, 5e-324]))  # fmt: skip
def test_any_increasing_times(steps, unit, size):
    times = np.unique(np.cumsum(np.array(steps, dtype=float)) * unit)
    times -= times[len(times) // 4]
    rows = [f"{t!r},{size * np.cos(i)!r},{size!r},0\n" for i, t in enumerate(times.tolist())]
    header = "time_s,angular_velocity_rad_s,drive_V,angle_deg\n"
    read_whatever(AXIS_TOML.replace("restart_s = 0.03", "").encode(), (header + "".join(rows)).encode())
    arm = ARM_TOML.replace("window_s = [0.0, 0.7]", "").replace("gyro_range_deg_s = 200", "")
    read_whatever(arm.encode(), ("time_s,angular_velocity_deg_s,a,b\n" + "".join(rows)).encode())


@many(120)
@given(st.binary(max_size=300), st.binary(max_size=300))
def test_any_bytes(toml, csv):
    read_whatever(toml, ARM_CSV.encode())
    read_whatever(ARM_TOML.encode(), csv)
    read_whatever(ARM_TOML.encode(), b"time_s,angular_velocity_deg_s\n" + csv)
