"""`armid new campaign NAME --from FILE...` guesses what the columns of files are, says so, and its campaign checks."""

import tomllib
from pathlib import Path
from warnings import catch_warnings, simplefilter

import numpy as np
import pytest

import synthetic
from armid import read_campaign
from armid.record.table import read_table

pytestmark = pytest.mark.usefixtures("in_a_folder")
N, INTERVAL = 2000, 0.004


def wheel(seed):
    """Return times [s], voltage, speed [rad/s] and angle [rad] of a motor with a wheel; the first second is rest."""
    rng = np.random.default_rng(seed)
    times = INTERVAL * np.arange(N)
    drive = np.where(times < 1.0, 0.0, np.repeat(rng.uniform(-6.0, 6.0, N // 100), 100))
    speed, angle = synthetic.wheel(drive, INTERVAL, 30.0, 2.0)
    return times, drive, speed + 0.05 * rng.standard_normal(N), angle


def spreadsheet(seed):
    """Return a file as a spreadsheet of a language with decimal commas writes it."""
    times, drive, speed, angle = wheel(seed)
    columns = (np.round(1e3 * times), np.round(drive, 3), np.round(speed * 30.0 / np.pi, 2),
               np.round(np.mod(np.rad2deg(angle), 360.0), 2))  # fmt: skip
    rows = "\n".join(";".join(f"{v:.9g}".replace(".", ",") for v in row) + ";run" for row in zip(*columns))
    return f"# logger\nZeit [ms];Motor voltage [V];speed [rpm];angle [\u00b0];state\n{rows}\n".encode("utf-16")


def test_files_of_a_spreadsheet_become_a_campaign_that_checks(run, refused, tmp_path):
    for seed, name in ((1, "first.csv"), (2, "second.csv")):
        (tmp_path / name).write_bytes(spreadsheet(seed))
    with catch_warnings():
        simplefilter("default")
        made = run("new", "campaign", "wheel", "--from", "first.csv", "second.csv")
    assert (made.code, made.out) == (0, "wrote wheel; try: armid check wheel\n")
    assert "read with UTF-16, ';' between columns" in made.err
    text = (tmp_path / "wheel" / "campaign.toml").read_text()
    sheet = tomllib.loads(text)
    assert (sheet["plant"], sheet["hold"], sheet["unwrap"]) == ("rotary_arm", "zero", True)
    assert [(r["file"], r["role"]) for r in sheet["records"]] == [("first.csv", "train"), ("second.csv", "holdout")]
    told = ("time_s: the column 'Zeit [ms]'", "drive_V: the column 'Motor voltage [V]'", 'role = "holdout"  # GUESS',
            "2000 rows at 250 Hz, 1.01 s of rest first; angular_velocity_rpm: steps of 0.01")  # fmt: skip
    for words in told:
        assert words in text, text
    times, drive, speed, _ = wheel(1)
    table = read_table(tmp_path / "wheel" / "first.csv", "first.csv").columns
    np.testing.assert_array_equal(table["time_s"], np.round(times, 12))
    np.testing.assert_array_equal(table["drive_V"], np.round(drive, 3))
    np.testing.assert_array_equal(table["angular_velocity_rpm"], np.round(speed * 30.0 / np.pi, 2))
    checked = run("check", "wheel")
    assert (checked.code, checked.err) == (0, "")
    assert "first.csv, train: 2000 samples at 250 Hz" in checked.out
    assert "exists already" in refused("new", "campaign", "wheel", "--from", "first.csv")


def write(path, header, *columns):
    rows = zip(*columns, strict=True)
    path.write_text("\n".join([header, *(",".join(f"{v:.9g}" for v in row) for row in rows)]) + "\n")


def test_a_unit_that_nothing_tells_is_a_guess_and_an_encoder_that_is_not_used_no_output(run, tmp_path):
    """Its counts would be an output, which wants those of a turn."""
    times, drive, speed, angle = wheel(3)
    write(tmp_path / "a.csv", "t,speed,u,angle_counts", times, speed, drive, np.round(angle * 4096 / (2.0 * np.pi)))
    assert run("new", "campaign", "mine", "--from", "a.csv").code == 0
    text = (tmp_path / "mine" / "campaign.toml").read_text()
    assert "angular_velocity_rad_s: the column 'speed'; GUESS: its unit" in text
    assert "time_s: the column 't'; GUESS: it is in s" in text
    assert "angle_counts, with counts_per_turn" in text
    assert [s.header for s in read_campaign(tmp_path / "mine").train[0].signals] == ["angular_velocity_rad_s"]


@pytest.mark.slow
def test_a_column_that_is_not_used_is_not_read_as_another_input_or_output(run, tmp_path):
    times, drive, _, angle = wheel(4)
    write(tmp_path / "motor.csv", "time_s,drive_V,current_A,angle_deg,angle_rad", times, drive, 0.2 * drive,
          np.rad2deg(angle), angle)  # fmt: skip
    assert run("new", "campaign", "motor", "--from", "motor.csv").code == 0
    table = read_table(tmp_path / "motor" / "motor.csv", "motor.csv").columns
    assert list(table) == ["time_s", "drive_V", "angle_deg", "unused_current_A", "unused_angle_rad"]
    np.testing.assert_allclose(table["drive_V"], drive, rtol=1e-8)
    assert run("check", "motor").code == 0


def test_times_of_day_in_some_files_alone_are_refused(refused, tmp_path):
    for file, clock in (("a.csv", "10:00:"), ("b.csv", "")):
        rows = [f"{clock}{i},0,{i}" for i in range(10, 60)]
        (tmp_path / file).write_text("\n".join(["Time,drive_V,angle_deg", *rows]))
    for files, words in ((("a.csv", "b.csv"), "numbers, times of day are expected"),
                         (("b.csv", "a.csv"), "times of day, numbers are expected")):  # fmt: skip
        sentence = refused("new", "campaign", "m", "--from", *files)
        assert f"line 1: 'Time' holds {words}, as in the first file" in sentence


@pytest.mark.nightly
def test_a_drive_that_never_changes_is_asked_about(run, tmp_path):
    times, _, speed, _ = wheel(5)
    write(tmp_path / "motor.csv", "time_s,drive_V,angular_velocity_rad_s", times, np.full(N, 3.0), speed)
    assert run("new", "campaign", "motor", "--from", "motor.csv").code == 0
    checked = run("check", "motor")
    assert (checked.code, "inputs: u is 3 in all samples of the train records" in checked.out) == (0, True)


def test_one_file_of_steps_tells_that_the_drive_is_held(run, tmp_path):
    times, drive, speed, _ = wheel(4)
    for name, driven in (("chirp.csv", np.sin(times**2)), ("steps.csv", drive)):
        write(tmp_path / name, "time_s,voltage_V,speed_rad_s", times, driven, speed)
    holds = {("chirp.csv",): "linear", ("chirp.csv", "steps.csv"): "zero"}
    for i, (files, hold) in enumerate(holds.items()):
        assert run("new", "campaign", f"c{i}", "--from", *files).code == 0
        text = (tmp_path / f"c{i}" / "campaign.toml").read_text()
        assert tomllib.loads(text)["hold"] == hold
    assert "constant between two rows, as its steps in 1 of the 2 files show" in text


@pytest.mark.slow
def test_a_parameter_among_the_constants_is_refused_with_the_key_to_write(run, refused, tmp_path):
    times, drive, speed, _ = wheel(5)
    write(tmp_path / "a.csv", "time_s,voltage_V,speed_rad_s", times, drive, speed)
    assert run("new", "campaign", "mine", "--from", "a.csv").code == 0
    sheet = tmp_path / "mine" / "campaign.toml"
    guessed = sheet.read_text()
    sheet.write_text(guessed.replace("[[records]]", "[constants]\ngain = 0.5\n\n[[records]]", 1))
    assert "is a parameter of plant 'rotary_arm', [parameters.gain] with fixed = VALUE is" in refused("check", "mine")
    sheet.write_text(guessed.replace("[[records]]", "[parameters.gain]\nfixed = 0.5\n\n[[records]]", 1))
    assert "with parameters in the middle of their ranges, measured up to" in run("check", "mine").out


@pytest.mark.parametrize(("text", "words"), [
    ("time_s,drive_V\n0,1\n1,2\n", "a speed or an angle"), ("time_s,speed\n0,1\n1,2\n", "an input"),
    ("speed,drive\n1,1\n1,2\n", "no column of"), ("time_s,angle_counts,drive_V\n0,1,2\n1,2,3\n", "in counts"),
    ("time_s,angle_deg,drive_V\n" + "".join(f"{i},,1\n" for i in range(30)), "'angle_deg' has 0 samples with a number"),
    ("time_s,speed_rad_s,drive_V\n0,1,2\n", "a.csv: 1 samples in the record, at least 20 are expected"),
    ("time_s,angle_deg,velocity_m_s,drive_N_m\n0,1,2,3\n1,2,3,4\n", "moves straight and 'angle_deg' of one that turns"),
])  # fmt: skip
def test_files_that_say_too_little_are_refused(refused, tmp_path, text, words):
    (tmp_path / "a.csv").write_text(text)
    assert words in refused("new", "campaign", "mine", "--from", "a.csv")
    assert not (tmp_path / "mine").exists()
    assert "records are expected of a campaign alone" in refused("new", "effect", "mine", "--from", "a.csv")
    assert "--from before the files" in refused("new", "campaign", "mine", "a.csv")


def plain_file(path, drive, times=None):
    own, voltage, speed, _ = wheel(3)
    own = own if times is None else times(own)
    write(path, f"t [s],{drive},w [rad/s],Temp [C]", own, 1e3 * voltage, speed, 7.0 + 0.0 * speed)


@pytest.mark.parametrize(("drive", "header", "factor"), [("U [mV]", "drive_V", 1e-3), ("I_mot [mA]", "current_A", 1e-3),
                                                          ("current [A]", "current_A", 1.0)])  # fmt: skip
def test_a_unit_with_a_prefix_is_no_other_number(run, tmp_path, drive, header, factor):
    plain_file(tmp_path / "a.csv", drive)
    assert run("new", "campaign", "wheel", "--from", "a.csv").code == 0
    table = read_table(tmp_path / "wheel" / "a.csv", "a.csv").columns
    np.testing.assert_allclose(table[header], 1e3 * factor * wheel(3)[1], rtol=1e-6)
    text = (tmp_path / "wheel" / "campaign.toml").read_text()
    assert (f", its numbers times {factor:g}" in text) == (factor != 1.0)
    assert "not used: 'Temp [C]'" in text


@pytest.mark.parametrize(("header", "speed"), [("Time (ms),Position (mm),Tacho (mm/s),I (A)", "velocity_mm_s"),
                                               ("t s,x mm,v m/min,I A", "velocity_m_min")])  # fmt: skip
def test_a_straight_machine_keeps_its_units(run, tmp_path, header, speed):
    rows = [f"{i},{50.0 + 0.01 * i * i},{0.02 * i},{0.1 * (i % 7)}" for i in range(60)]
    (tmp_path / "a.csv").write_text("\n".join([header, *rows, ""]))
    assert run("new", "campaign", "lift", "--from", "a.csv").code == 0
    table = read_table(tmp_path / "lift" / "a.csv", "a.csv").columns
    assert {"position_mm", speed, "current_A"} <= set(table)
    assert table["position_mm"][0] == 50.0
    assert table["time_s"][1] == pytest.approx(1e-3 if "ms" in header else 1.0)
    assert "GUESS: its unit" not in (tmp_path / "lift" / "campaign.toml").read_text()


def test_an_unknown_unit_and_a_time_that_falls_are_refused_and_an_input_may_have_any_unit(refused, tmp_path, run):
    (tmp_path / "a.csv").write_text("t [s],U [V],angle [gon]\n0,1,2\n1,1,3\n")
    assert "the unit of 'angle [gon]' is 'gon': one of deg, " in refused("new", "campaign", "wheel", "--from", "a.csv")
    plain_file(tmp_path / "b.csv", "U [V]", lambda t: np.where(np.arange(N) < 900, t, t - 2.0))
    assert "time does not rise from row 900 to row 901" in refused("new", "campaign", "wheel", "--from", "b.csv")
    assert not (tmp_path / "wheel").exists()
    plain_file(tmp_path / "a.csv", "duty [%]")
    assert run("new", "campaign", "wheel", "--from", "a.csv").code == 0
    assert "command" in read_table(tmp_path / "wheel" / "a.csv", "a.csv").columns
    assert run("check", "wheel").code == 0


@pytest.mark.slow
def test_the_plant_of_a_plug_in_is_the_one_of_the_campaign(run, refused):
    times, drive, speed, _ = wheel(5)
    write(Path("a.csv"), "t_s,motor_V,speed_km_h,speed_rad_s", times, drive, 3.6 * speed, speed)
    plugin = f"{Path(__file__).parents[1] / 'winch.py'}:winch"
    made = run("new", "campaign", "mine", "--from", "a.csv", "--plugin", plugin)
    assert made.out == f"wrote mine; try: armid check mine --plugin {plugin}\n"
    toml = tomllib.loads(Path("mine/campaign.toml").read_text())
    assert (toml["plant"], toml["inputs"]) == ("winch", {"volts": "volts_V"})
    assert "hold" not in toml, "the plant says what its input does between two rows"
    # a line that only has to be uncommented where a constant of a record is another
    (own,) = [line for line in Path("mine/campaign.toml").read_text().splitlines() if line.startswith("# constants")]
    assert tomllib.loads(own[2:])["constants"] == {"start_speed": 0}, own
    assert run("check", "mine", "--plugin", plugin).code == 0
    assert "a campaign that is made by --from is expected" in refused("new", "effect", "x", "--plugin", plugin)


SLIDE = """
from armid import Input, Output, Parameter, Plant, Scales, State

slide = Plant(
    name="slide", parameters=(Parameter("mass", "kg", 1.0, 9.0), Parameter("gain", "N/V", 1.0, 9.0)),
    states=(State("x", "m", lambda v: v, lambda: 0.0),
            State("v", "m/s", lambda volts, gain, mass: gain * volts / mass, lambda: 0.0)),
    inputs=(Input("volts", "V"),), outputs=(Output("slide", "x", "m"),), aliases={"omega": "v", "theta": "x"},
    scales=Scales(effort=1.0, speed=1.0),
)
"""


def test_counts_of_an_encoder_ask_for_their_turn(run, refused):
    times, drive, _, angle = wheel(5)
    write(Path("a.csv"), "t_s,motor_V,turn_counts", times, drive, np.rint(angle * 100.0))
    turner = SLIDE.replace('"m"', '"rad"').replace('"m/s"', '"rad/s"').replace('"kg"', '"kg m2"')
    Path("turner.py").write_text(turner.replace('"N/V"', '"N m/V"').replace('Output("slide"', 'Output("turn"'))
    assert run("new", "campaign", "mine", "--from", "a.csv", "--plugin", "turner.py:slide").code == 0
    assert "counts_per_turn of the encoder is expected" in refused("check", "mine", "--plugin", "turner.py:slide")
    text = Path("mine/campaign.toml").read_text()
    assert "# counts_per_turn = 4096  # of the encoder of turn_counts: how many make a turn?\n" in text
    assert "# constants" not in text
    Path("mine/campaign.toml").write_text(text.replace("# counts_per_turn = 4096", "counts_per_turn = 628"))
    assert run("check", "mine", "--plugin", "turner.py:slide").code == 0


@pytest.mark.slow
def test_a_position_of_a_linear_axis_is_what_a_plant_of_armid_and_the_plant_of_a_plug_in_reads(run, refused):
    times, drive, _, angle = wheel(5)
    write(Path("a.csv"), "t_s,motor [mV],slide_mm", times, drive, angle)
    Path("slide.py").write_text(SLIDE)
    assert run("new", "campaign", "straight", "--from", "a.csv").code == 0
    toml = tomllib.loads(Path("straight/campaign.toml").read_text())
    assert (toml["plant"], toml["hold"]) == ("linear_axis", "zero")
    assert run("check", "straight").code == 0
    assert run("new", "campaign", "mine", "--from", "a.csv", "--plugin", "slide.py:slide").code == 0
    toml = tomllib.loads(Path("mine/campaign.toml").read_text())
    assert (toml["inputs"], toml["hold"]) == ({"volts": "volts_V"}, "zero")
    assert Path("mine/a.csv").read_text().startswith("time_s,slide_mm,volts_V")
    assert run("check", "mine", "--plugin", "slide.py:slide").code == 0
    write(Path("b.csv"), "t_s,motor_V,turn_deg", times, drive, angle)
    assert "slide_m" in refused("new", "campaign", "other", "--from", "b.csv", "--plugin", "slide.py:slide")


def test_a_file_whose_names_are_the_outputs_of_a_shipped_plant_is_of_that_plant(run, tmp_path):
    times, drive, _, angle = wheel(5)
    write(tmp_path / "a.csv", "time_s,current_A,hub_angle_deg,deflection_deg", times, drive, angle, 0.1 * angle)
    assert run("new", "campaign", "shaft", "--from", "a.csv").code == 0
    text = (tmp_path / "shaft" / "campaign.toml").read_text()
    assert 'plant = "flexible_link"  # GUESS' in text
    assert "not used" not in text
    signals = read_campaign(tmp_path / "shaft").train[0].signals
    assert [s.header for s in signals] == ["hub_angle_deg", "deflection_deg"]


def test_units_in_one_word_are_read_as_such(run):
    times, drive, speed, _ = wheel(5)
    for name, header, factor in (("a", "turn_dps", "deg"), ("b", "turn_radps", "rad"), ("c", "way_mps", "m")):
        write(Path(f"{name}.csv"), f"t_s,duty_pct,{header}", times, drive, speed)
        assert run("new", "campaign", name, "--from", f"{name}.csv").code == 0
        assert Path(f"{name}/{name}.csv").read_text().partition("\n")[0].endswith(f"_{factor}_s")
        assert "its unit" not in Path(f"{name}/campaign.toml").read_text()
