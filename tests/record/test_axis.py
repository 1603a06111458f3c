"""Records of a driven axis: start state, restarts, inputs, scales, units."""

from dataclasses import replace

import numpy as np
import pytest

from armid.errors import ArmidError
from armid.model import Constant, Input, Manoeuvre, Plant
from armid.model.plants.driven_axis import driven_axis
from armid.record import read_campaign
from commands import refusing
from synthetic import write_records
from winch import INTERVAL, exact_speed, held_voltage, winch

DEGREE, WAVE = np.pi / 180, np.sin(np.arange(5501) / 100)
HOLDOUT = '\n[[records]]\nfile = "hold.csv"\nrole = "holdout"\n'
AXIS = 'name = "a"\nplant = "driven_axis"\n{}\n[[records]]\nfile = "move.csv"\nrole = "train"\n'


def test_starts_from_the_measured_state(write_axis, axis_columns):
    record = read_campaign(write_axis()).records[0]
    constants = record.pieces[0].manoeuvre.constants
    assert constants["gain"] == 35.0
    assert constants["start_speed"] == pytest.approx(axis_columns["velocity_m_s"][0], abs=5e-5)
    assert constants["start_position"] == pytest.approx(axis_columns["position_m"][0], abs=2e-7)
    np.testing.assert_array_equal(record.pieces[0].manoeuvre.inputs["u"], axis_columns["drive_V"])
    np.testing.assert_array_equal(record.columns["position_m"], axis_columns["position_m"])
    assert record.noise.source == "differences"
    assert record.noise.mean is None
    assert record.is_noise_free


@pytest.mark.parametrize(("begins", "first"), [(7.25, 0), (-0.5, 500)])
def test_first_sample_starts_the_clock_and_samples_before_zero_do_not_count(write_axis, axis_columns, begins, first):
    record = read_campaign(write_axis(columns={**axis_columns, "time_s": axis_columns["time_s"] + begins})).records[0]
    assert record.manoeuvre.start_time == pytest.approx(begins)
    assert record.rest.size == 0
    assert record.pieces[0].window == slice(first, 5501)
    np.testing.assert_allclose(record.times[[0, -1]], [begins, begins + 5.5])


def test_scales_come_from_train_records_only_and_the_hold_of_a_record_wins(write, axis_columns):
    toml = AXIS.format("[constants]\ngain = 35.0") + HOLDOUT
    holdout = {name: values if name == "time_s" else values * 10 for name, values in axis_columns.items()}
    campaign = read_campaign(write(toml, move=axis_columns, hold=holdout))
    assert campaign.plant.scales.effort == pytest.approx(35.0 * np.max(np.abs(axis_columns["drive_V"])))
    assert campaign.plant.scales.speed == pytest.approx(np.max(np.abs(axis_columns["velocity_m_s"])))
    assert (campaign.plant.scales.effort_unit, campaign.plant.scales.length_unit) == ("N", "m")
    assert driven_axis.scales.effort == 1.0
    # a constant whose tolerance nobody told is taken as exact
    for told, exact in (("", ("gain",)), ("[tolerances]\ngain = 0", ()), ("[tolerances]\ndefault = 0.02", ())):
        toml = AXIS.format(f"[constants]\ngain = 35.0\n{told}")
        assert read_campaign(write(toml, move=axis_columns)).taken_as_exact == exact
    toml = AXIS.format('hold = "zero"') + HOLDOUT + 'hold = "linear"\n'
    records = read_campaign(write(toml, move=axis_columns, hold=axis_columns)).records
    assert [r.manoeuvre.hold for r in records] == ["zero", "linear"]
    assert isinstance(records[0].manoeuvre, Manoeuvre)


@pytest.mark.parametrize(("speed", "position", "factor"), [
    ("angular_velocity_rad_s", "angle_rad", 1.0), ("angular_velocity_deg_s", "angle_deg", DEGREE),
])  # fmt: skip
def test_the_rotary_axis_is_found_by_the_unit(write_axis, axis_columns, speed, position, factor):
    columns = {"time_s": axis_columns["time_s"], speed: axis_columns["velocity_m_s"] / factor,
               position: axis_columns["position_m"] / factor, "drive_N_m": 0.0 * axis_columns["drive_V"]}  # fmt: skip
    campaign = read_campaign(write_axis(columns=columns, toml=AXIS.format("[constants]\ngravity_moment = 1.5")))
    assert campaign.unit == "rad/s"
    # a pendulum without a drive takes its scale from gravity
    assert campaign.plant.scales.effort == 1.5
    assert [p.name for p in campaign.plant.parameters] == ["inertia"]
    np.testing.assert_allclose(campaign.records[0].measured, axis_columns["velocity_m_s"])
    assert campaign.records[0].constants["start_position"] == pytest.approx(axis_columns["position_m"][0], abs=2e-7)


def test_restarts_cut_pieces_from_measured_states(write_axis, axis_columns):
    record = read_campaign(write_axis("restart_s = 1.0\n")).records[0]
    assert [p.start_index for p in record.pieces] == [0, 1000, 2000, 3000, 4000]
    assert record.n_samples == 5000
    for piece in record.pieces:
        rows = slice(piece.start_index, piece.start_index + 1000)
        np.testing.assert_array_equal(piece.of(record.measured), axis_columns["velocity_m_s"][rows])
        np.testing.assert_array_equal(piece.manoeuvre.inputs["u"], axis_columns["drive_V"][rows])
        assert piece.manoeuvre.start_time == pytest.approx(axis_columns["time_s"][piece.start_index])
        state = piece.manoeuvre.constants
        assert state["start_speed"] == pytest.approx(axis_columns["velocity_m_s"][piece.start_index], abs=3e-5)
        assert state["start_position"] == pytest.approx(axis_columns["position_m"][piece.start_index], abs=3e-7)


def test_named_inputs_win_and_degrees_become_radians(write, axis_columns):
    plant = Plant(
        name="servo", parameters=driven_axis.parameters, states=driven_axis.states, output="v", output_unit="m/s",
        quantities=driven_axis.quantities, constants=driven_axis.constants, ports=driven_axis.ports,
        scales=driven_axis.scales, from_rest=False,
        inputs=(*driven_axis.inputs, Input("table_angle", "rad"), Input("wind", "m/s", ("wind_m_s",), required=False)),
    )  # fmt: skip
    columns = {**axis_columns, "reserve_V": axis_columns["drive_V"] + 1.0, "table_deg": axis_columns["time_s"]}
    toml = AXIS.format('[inputs]\ntable_angle = "table_deg"').replace("driven_axis", "servo")
    toml += '[records.inputs]\nu = "reserve_V"\n'
    manoeuvre = read_campaign(write(toml, move=columns), plants={"servo": plant}).records[0].manoeuvre
    np.testing.assert_array_equal(manoeuvre.inputs["u"], columns["reserve_V"])
    np.testing.assert_allclose(manoeuvre.inputs["table_angle"], columns["table_deg"] * DEGREE)
    np.testing.assert_array_equal(manoeuvre.inputs["wind"], 0.0)


@pytest.mark.parametrize(("more", "change", "fragments"), [
    ("restart_s = 9.0\n", {}, ["restart_s is 9", "5.501"]),
    ("restart_s = 0.01\n", {}, ["restart_s is 0.01", "10 samples", "20"]),
    ("[records.constants]\ngravity_moment = 1.0\n", {"position_m": None}, ["move.csv", "gravity_moment", "position_m"]),
    ("[records.constants]\nstart_speed = 1.0\n", {}, ["start_speed", "first samples"]),
    ("[records.inputs]\nu = 'drive_v'\n", {}, ["'drive_v'", "move.csv", "did you mean 'drive_V'"]),
    ("", {"drive_V": None}, ["move.csv, line 1", "input 'u'", "drive_N_m"]),
    ("", {"drive_V": None, "drive_kN": 1.0}, ["move.csv, line 1", "'drive_kN'", "unknown unit", "drive_N"]),
    ("", {"drive_N": 1.0}, ["drive_V and drive_N", "move.csv, line 1"]),
    ("", {"drive_V": None, "motor_V": 1.0}, ["drive_N_m", "or u = 'motor_V' (numbers in V, N or N m) under [inputs]"]),
    ("", {"drive_V": 0.0}, ["drive", "0 throughout"]),
    ("", {"velocity_m_s": None, "angular_velocity_rad_s": WAVE, "angle_rad": 0.0, "angle_deg": 0.0},
     ["angle_rad and angle_deg", "at most one position"]),
])  # fmt: skip
def test_refused(write_axis, axis_columns, more, change, fragments):
    columns = dict(axis_columns)
    for name, value in change.items():
        if value is None:
            del columns[name]
        else:
            columns[name] = np.full(5501, value) if isinstance(value, float) else value
    with refusing(*fragments):
        read_campaign(write_axis(more, columns))
    with pytest.raises(ArmidError, match=r"gyro_range_deg_s.*m/s"):
        read_campaign(write_axis(toml=AXIS.format("gyro_range_deg_s = 200")))


# what the reader owes a plant that someone else wrote, and what it does not assume in silence
SERVO = replace(
    driven_axis, name="servo", variants=(), scales_from_records=False,
    constants=(Constant("gain", 1.0, "N/V"), Constant("kp", 5.0, "V/m"), Constant("start_position", 0.0, "m"),
               Constant("start_speed", 0.0, "m/s")),
    quantities={**driven_axis.quantities, "gravity_effort": lambda q, kp: -kp * q},
    inputs=(Input("u", "V", ("drive_V",)), Input("fan", "1", ("fan",), required=False, default=1.0, hold="zero")),
)  # fmt: skip
SERVO_TOML = 'name = "a"\nplant = "servo"\n[[records]]\nfile = "move.csv"\nrole = "train"\n'


def read(folder):
    return read_campaign(folder, plants={"servo": SERVO})


def test_scales_stay_an_optional_input_has_its_default_and_a_start_position_needs_a_column(write, axis_columns):
    campaign = read(write(SERVO_TOML, move=axis_columns))
    assert campaign.plant.scales == SERVO.scales
    np.testing.assert_array_equal(campaign.records[0].manoeuvre.inputs["fan"], 1.0)
    off = {**axis_columns, "fan": np.zeros(5501)}
    np.testing.assert_array_equal(read(write(SERVO_TOML, move=off)).records[0].manoeuvre.inputs["fan"], 0.0)
    columns = {name: values for name, values in axis_columns.items() if name != "position_m"}
    with pytest.raises(ArmidError, match=r"campaign/move\.csv, line 1: .*'servo' declares it: a column position_m"):
        read(write(SERVO_TOML, move=columns))


def test_irregular_times_keep_switch_and_force_apart(write, axis_columns):
    rng = np.random.default_rng(5)
    times = axis_columns["time_s"] + np.append(0.0, rng.uniform(-2e-4, 2e-4, 5500))
    fan = np.where(np.arange(5501) < 3000, 1.0, 0.0)
    with pytest.warns(match="campaign/move.csv: irregular sampling"):
        record = read(write(SERVO_TOML, move={**axis_columns, "time_s": times, "fan": fan})).records[0]
    held, drive = (record.manoeuvre.inputs[name] for name in ("fan", "u"))
    assert np.sum((held > 0) & (held < 1)) <= 1
    # the file pairs the drive of the even time with the uneven one
    np.testing.assert_allclose(drive, np.interp(record.times, times, axis_columns["drive_V"]), atol=1e-12)


def test_what_is_known_beforehand_is_read(write_axis):
    told = "[constants]\ngain = 35.0\n[priors]\ncoulomb = 0.9\nmass = { mean = 90.0, sd = 4.0 }\n"
    campaign = read_campaign(write_axis(toml=AXIS.format(told)))
    assert campaign.chances == {"coulomb": 0.9}
    assert (campaign.known["mass"].mean, campaign.known["mass"].sd) == (90.0, 4.0)
    told = "[priors]\ngain = { mean = 35.0, sd = 0.7 }\n"
    campaign = read_campaign(write_axis(toml=AXIS.format(told)))
    assert campaign.constants["gain"] == 35.0
    assert campaign.tolerances["gain"] == pytest.approx(0.02)
    assert campaign.known == {}


@pytest.mark.parametrize(("prior", "said"), [
    ("coulomb = 1.5", "priors.coulomb' is 1.5"),
    ("coulom = 0.5", "did you mean 'coulomb'"),
    ("mas = { mean = 1.0, sd = 1.0 }", "did you mean 'mass'"),
    ("mass = { mean = 1.0, sd = -1.0 }", "a standard deviation above 0"),
    ("gain = { mean = 0.0, sd = 1.0 }", "a mean other than 0"),
    ("gain = { mean = 35.0, sd = 1.0 }\n[constants]\ngain = 35.0", "one place is expected"),
])  # fmt: skip
def test_a_prior_that_means_nothing_is_refused(write_axis, prior, said):
    with refusing(said):
        read_campaign(write_axis(toml=AXIS.format(f"[priors]\n{prior}\n")))


def test_an_input_is_read_in_another_unit_of_its_header(tmp_path):
    volts = held_voltage(np.random.default_rng(2))
    times = np.round(INTERVAL * np.arange(len(volts)), 9)
    table = {"time_s": times, "angular_velocity_rad_s": exact_speed(volts, 0.0), "volts_mV": 1e3 * volts}
    folder = write_records(tmp_path / "campaign", 'name = "winch"\nplant = "winch"\n', {"a.csv": table}, holdout=0)
    (record,) = read_campaign(folder, {"winch": winch}).records
    np.testing.assert_allclose(record.manoeuvre.inputs["volts"], volts)
