"""Several outputs of a plant: declared, simulated at once, and read from the columns of a record."""

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from two_inertias import INTERVAL, NOISE_ANGLE, NOISE_SPEED, TRUTH, drive, oracle, two_inertias, write_drive

from armid.contract.equations import check_effects, check_plant
from armid.engine import Schedule, simulate
from armid.errors import ArmidError
from armid.model import EFFECTS, PLANTS, Manoeuvre, Model, Output
from armid.model.effects.sensor import sensor_effects
from armid.record import read_campaign, write_campaign
from armid.record.table import read_table
from commands import ended
from winch import winch

START = np.array([0.1, 0.5, 0.05, 0.4])
STARTS = dict(zip(("start_motor", "start_motor_speed", "start_load", "start_load_speed"), START, strict=True))


@pytest.mark.slow
def test_one_simulation_gives_all_outputs_as_scipy_does_and_loses_all_where_it_diverges():
    u = drive(400, 1.0)
    run = simulate(Model(two_inertias), Manoeuvre(INTERVAL, 400, STARTS, {"u": u}), list(TRUTH.values()), Schedule(8))
    expected = oracle(u, START)
    np.testing.assert_allclose(run.outputs[0, 0], expected["v"], atol=1e-8)
    np.testing.assert_allclose(run.outputs[1, 0], expected["p"], atol=1e-8)
    np.testing.assert_allclose(run.outputs[2, 0], expected["p"] - expected["q"], atol=1e-8)
    alone = simulate(Model(two_inertias.recording({"load_angle"})), Manoeuvre(INTERVAL, 400, STARTS, {"u": u}),
                     list(TRUTH.values()), Schedule(8))  # fmt: skip
    np.testing.assert_array_equal(alone.output, run.outputs[1])
    # The stiffness of a spring that pushes lets the angle run away first.
    manoeuvre = Manoeuvre(INTERVAL, 900, STARTS, {"u": drive(900, 1.0)})
    run = simulate(Model(two_inertias), manoeuvre, [list(TRUTH.values()), [0.1, 0.08, -250.0, 0.12]], Schedule(4))
    assert run.failed.tolist() == [False, True]
    assert np.isfinite(run.outputs[:, 0]).all()
    assert np.isnan(run.outputs[:, 1, -1]).all()


def test_the_old_way_declares_one_output_and_a_wrong_one_is_refused():
    for plant in PLANTS.values():
        for one in (plant, *plant.variants):
            if one.records_one_speed:
                names = {"rad/s": "angular_velocity", "m/s": "velocity"}
                assert [o.name for o in one.outputs] == [names[one.output_unit]]
    assert (two_inertias.output, two_inertias.output_unit) == ("recorded_speed", "rad/s")
    assert replace(two_inertias, note="x").outputs == two_inertias.outputs
    assert "recorded load_angle [rad]: recorded_load" in str(Model(two_inertias))
    with pytest.raises(ArmidError, match="unit 'deg'"):
        Output("angle", "q", "deg")
    with pytest.raises(ArmidError, match="a name that ends in _deg or _rad"):
        Output("angle", "q", "rad", ("angle",))
    with pytest.raises(ArmidError, match="one of them, or the first output 'recorded_speed' in rad/s"):
        replace(two_inertias, output="v")
    with pytest.raises(ArmidError, match="each name once"):
        replace(two_inertias, outputs=two_inertias.outputs[:1] * 2)


@pytest.mark.nightly
def test_a_sensor_has_effects_at_the_port_of_its_output():
    found = sensor_effects(two_inertias)
    assert list(found) == ["load_angle_bias", "load_angle_scale", "load_angle_delay", "load_angle_lag"]
    u = drive(300, 1.0)
    manoeuvre, truth = Manoeuvre(INTERVAL, 300, STARTS, {"u": u}), list(TRUTH.values())
    model = Model(two_inertias, tuple(found.values()))
    population = [[*truth, 0.0, 0.0, 0.0, 0.0], [*truth, 0.05, 0.1, 0.0, 0.0]]
    still, moved = simulate(model, manoeuvre, population, Schedule(4)).outputs[1]
    np.testing.assert_allclose(moved, 1.1 * still + 0.05, atol=1e-12)
    assert Model(two_inertias) + EFFECTS["gyro_bias"]
    points = check_effects([*found.values(), EFFECTS["coulomb"]], {"two_inertias": two_inertias})
    assert [p for _, p in points if not p.passed] == []
    assert [p for p in check_plant(two_inertias) if not p.passed] == []


def test_simulate_writes_every_output(tmp_path):
    folder = write_drive(tmp_path / "drive", more="".join(f"constants.{name} = 0.0\n" for name in STARTS))
    plugin = f"--plugin={Path(__file__).parent / 'two_inertias.py'}:two_inertias"
    values = [f"--set={name}={value}" for name, value in TRUTH.items()]
    assert ended("simulate", folder, plugin, *values, "--out", tmp_path / "out") == 0
    table = read_table(tmp_path / "out" / "b.csv", "b.csv").columns
    assert list(table) == ["time_s", "motor_speed_rad_s", "load_angle_deg", "deflection_rad", "load_speed_rad_s"]
    measured = read_table(folder / "a.csv", "a.csv").columns
    simulated = read_table(tmp_path / "out" / "a.csv", "a.csv").columns
    assert np.std(measured["load_angle_deg"] - simulated["load_angle_deg"]) < np.rad2deg(2.0 * NOISE_ANGLE)


def test_a_record_brings_any_outputs_in_the_unit_of_its_header(tmp_path):
    campaign = read_campaign(write_drive(tmp_path / "drive"), {"two_inertias": two_inertias})
    assert [o.name for o in campaign.plant.outputs] == ["motor_speed", "load_angle", "deflection"]
    assert [o.name for o in campaign.unmeasured] == ["load_speed"]
    all_three = ["motor_speed", "load_angle", "deflection"]
    held = [[signal.output for signal in r.signals] for r in campaign.records]
    assert held == [all_three, ["load_angle"], all_three]
    speed, angle, _ = campaign.records[0].signals
    assert (speed.unit, angle.unit, campaign.unit) == ("rad/s", "rad", "rad/s")
    assert speed.noise.rms == pytest.approx(NOISE_SPEED, rel=0.15)
    assert angle.noise.rms == pytest.approx(NOISE_ANGLE, rel=0.15)


@pytest.mark.parametrize(("header", "warned"), [("load_speed_turns_s", False), ("load_speed_mm_s", True)])
def test_a_column_that_has_the_name_of_an_output_and_no_unit_of_it_is_told(tmp_path, header, warned):
    folder = write_drive(tmp_path / "drive")
    for file in folder.glob("*.csv"):
        first, *rows = file.read_text().splitlines()
        file.write_text("\n".join([f"{first},{header}", *(f"{row},{i % 7}" for i, row in enumerate(rows))]))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        campaign = read_campaign(folder, {"two_inertias": two_inertias})
    assert ("load_speed" in [o.name for o in campaign.plant.outputs]) != warned
    texts = [str(w.message) for w in caught if "is not read as output 'load_speed', load_speed_deg_s" in str(w.message)]
    assert bool(texts) == warned


def test_every_state_of_the_start_comes_from_the_outputs_unless_it_is_given(tmp_path):
    """A record in motion: what nothing shows keeps its default and the plant's size; errors are within deviations."""
    campaign = read_campaign(write_drive(tmp_path / "drive"), {"two_inertias": two_inertias})
    _, train, held = campaign.records
    for record, truth in ((train, [0.3, 2.0, 0.25, 1.6]), (held, [-0.2, 1.0, -0.2, 1.2])):
        piece = record.pieces[0]
        for name, expected in zip(STARTS, truth, strict=True):
            assert abs(piece.manoeuvre.constants[name] - expected) < 4.0 * piece.start_deviation[name]
    hidden = {n for n, d in train.pieces[0].start_deviation.items() if d == pytest.approx(5.0)}
    assert hidden == {"start_motor", "start_motor_speed"}
    assert train.pieces[0].start_deviation["start_load_speed"] < 0.4
    assert train.pieces[0].shown_start
    # of the record held out the first 5 % tell the start and judge nothing
    assert (held.pieces[0].n_spent, held.pieces[0].window) == (35, slice(35, 700))
    assert not held.pieces[0].shown_start
    given = "".join(f"constants.{name} = 0.0\n" for name in STARTS)
    campaign = read_campaign(write_drive(tmp_path / "given", more=given), {"two_inertias": two_inertias})
    piece = campaign.holdout[0].pieces[0]
    assert (piece.window, piece.shown_start, piece.start_deviation) == (slice(0, 700), {}, {})
    with pytest.raises(ArmidError, match="restart_s and the constant start_load are both given"):
        read_campaign(write_drive(tmp_path / "again", more=f"{given}restart_s = 1.0\n"), {"two_inertias": two_inertias})


@pytest.mark.parametrize(("change", "said"), [
    (lambda text: text.replace("load_angle_deg", "load_angle_grad"), "load_angle_deg"),
    (lambda text: text.replace("load_angle_deg", "motor_speed_deg_s", 1), "one column of motor_speed is expected"),
])  # fmt: skip
def test_columns_that_say_nothing_clear_are_refused(tmp_path, change, said):
    folder = write_drive(tmp_path / "drive")
    for name in "bc":
        path = folder / f"{name}.csv"
        path.write_text(change(path.read_text()))
    with pytest.raises(ArmidError, match=said):
        read_campaign(folder, {"two_inertias": two_inertias})


def test_sensors_of_a_speed_fit_no_output_in_another_unit():
    """A drum turns in rad/s, the belt on it is recorded in m/s."""
    belt = {"belt": lambda w: 0.08 * w, "recorded_speed": lambda belt, output: belt + output}
    output = Output("belt_speed", "recorded_speed", "m/s", port="output")
    plant = replace(winch, quantities=winch.quantities | belt, ports=winch.ports | {"output": "m/s"}, output="",
                    output_unit="", outputs=(output,))  # fmt: skip
    with pytest.raises(ArmidError, match="'gyro_lag', port 'output', asks for 'omega'"):
        Model(plant) + EFFECTS["gyro_lag"]
    found = sensor_effects(plant)
    assert list(found) == ["belt_speed_bias", "belt_speed_scale", "belt_speed_delay", "belt_speed_lag"]
    assert (Model(plant) + found["belt_speed_bias"]).parameters["belt_speed_bias.bias"].unit == "m/s"
    assert Model(plant) + found["belt_speed_lag"]
    assert not sensor_effects(winch)


def test_a_force_far_above_the_scale_of_effort_is_no_motion_that_diverges(tmp_path):
    strong = replace(two_inertias, quantities={**two_inertias.quantities, "push": lambda v: 1e5 * v},
                     outputs=(two_inertias.outputs[0], Output("push", "push", "N")))  # fmt: skip
    speed = np.sin(np.linspace(0.0, 9.0, 700))
    columns = {"time_s": INTERVAL * np.arange(700), "motor_speed_rad_s": speed, "push_N": 1e5 * speed,
               "drive_N_m": drive(700, 1.0)}  # fmt: skip
    toml = 'name = "strong"\nplant = "two_inertias"\n[[records]]\nfile = "a.csv"\nrole = "train"\n'
    toml += "".join(f"constants.{name} = 0.0\n" for name in STARTS)
    campaign = read_campaign(write_campaign(tmp_path / "strong", toml, {"a.csv": columns}), {"two_inertias": strong})
    assert [plant.sizes for plant in (strong, campaign.plant)] == [
        (strong.scales.speed, strong.scales.effort), (strong.scales.speed, pytest.approx(1e5, rel=1e-3)),
    ]  # fmt: skip
