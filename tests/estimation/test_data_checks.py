"""Mistakes in campaigns are noticed, in words that name them; right campaigns are not accused."""

import re
import shutil
import warnings
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from armid.contract.check import check_campaign, far_from_typical
from armid.engine.simulate import Prepared
from armid.errors import ArmidError
from armid.estimation.corrections import Correction, moved
from armid.estimation.data_checks import DataTrial, chosen, data_issues, shortened
from armid.model import EFFECTS
from armid.problem.space import space_of
from armid.record import read_campaign, write_table
from armid.record.table import read_table
from synthetic import moved as stepped
from synthetic import write_records

SPEED = "angular_velocity_deg_s"
TRAIN = ("lower.csv", "raise.csv", "short.csv", "empty.csv")
ALL = (*TRAIN, "lower_low_voltage.csv", "raise_empty.csv")
PENDULUM = """\
name = "pendulum"
plant = "driven_axis"
constants.gravity_moment = 0.4
[parameters.inertia]
low = 0.02
high = 0.2
"""
AXIS = ("slow.csv", "fast.csv", "other.csv")


def rewritten(function, *files):
    """Return a mistake in some files: a function of their columns."""

    def made(folder):
        for file in files:
            write_table(folder / file, function(dict(read_table(folder / file, file).columns)))

    return made


def change(column, function, *files):
    return rewritten(lambda columns: columns | {column: function(columns[column])}, *files)


def toml(*pairs, more=""):
    def made(folder):
        path = folder / "campaign.toml"
        text = path.read_text()
        for old, new in pairs:
            assert old in text
            text = text.replace(old, new, 1)
        path.write_text(text + more)

    return made


def angles_in_radians(folder):
    path = folder / "campaign.toml"
    found = re.compile(r"^(.*_angle_deg) = (.*)$", re.MULTILINE)
    path.write_text(found.sub(lambda m: f"{m[1]} = {np.deg2rad(float(m[2])):.4f}", path.read_text()))


def exchange(a, b):
    def made(folder):
        (folder / a).rename(folder / "x")
        (folder / b).rename(folder / a)
        (folder / "x").rename(folder / b)

    return made


def exchange_column(column, a, b):
    def made(folder):
        tables = [dict(read_table(folder / file, file).columns) for file in (a, b)]
        for file, table, other in zip((a, b), tables, tables[::-1], strict=True):
            write_table(folder / file, table | {column: other[column]})

    return made


def copied(source, name, role, more=""):
    """Return a mistake: a recording under another name, as another record."""

    def made(folder):
        shutil.copy(folder / source, folder / name)
        text = (folder / "campaign.toml").read_text()
        entry = next(e for e in text.split("[[records]]") if f'"{source}"' in e).strip()
        entry = re.sub('role = "[a-z]+"', f'role = "{role}"', entry.replace(source, name))
        (folder / "campaign.toml").write_text(f"{text}\n[[records]]\n{entry}\n{more}")

    return made


def late(seconds, *files):
    return change("time_s", lambda t: np.round(t + seconds, 6), *files)


def noise(*files):
    return change(SPEED, lambda x: np.random.default_rng(5).normal(0, 20, x.size), *files)


@cache
def swing(size, pace, friction):
    """Return angle [deg] and speed [deg/s] of the pendulum under a drive: many tests want the same ones."""
    drive = size * np.sin(pace * 0.004 * np.arange(900)) + 0.1
    rates = lambda x, u: np.array([x[1], (u - 0.4 * np.sin(x[0]) - friction * x[1]) / 0.06])  # noqa: E731
    return np.rad2deg(stepped(rates, drive, 0.004, (0.0, 0.0))).T


def pendulum(folder, seed=1, friction=0.004):
    """Write a SYNTHETIC driven pendulum with friction that is not declared, by Runge-Kutta steps of its own."""
    rng, times, tables = np.random.default_rng(seed), 0.004 * np.arange(900), {}
    for file, size, pace in zip(AXIS, (0.5, 0.35, 0.6), (2.0, 5.0, 3.1), strict=True):
        drive = size * np.sin(pace * times) + 0.1
        angle, speed = swing(size, pace, friction)
        tables[file] = {"time_s": times, "angular_velocity_deg_s": speed + rng.normal(0, 0.3, times.size),
                        "angle_deg": angle + rng.normal(0, 0.05, times.size), "drive_N_m": drive}  # fmt: skip
    return write_records(folder, PENDULUM, tables)


def constant(text):
    return toml(("gyro_range_deg_s = 200", f"gyro_range_deg_s = 200\nconstants = {{ {text} }}"))


# Of the strokes at 1 kHz every so many-th sample is kept: a mistake shows in them as well, in half of the time.
EVERY = 4
NO_RANGE, ONE = toml(("gyro_range_deg_s = 200\n", "")), ("lower.csv",)
# name of the mistake: campaign, what is done to it, words that must be said.
MISTAKES = {
    "one speed inverted": ("arm", (change(SPEED, np.negative, "raise.csv"),), r"raise\.csv.*sign looks inverted"),
    "held-out inverted": ("arm", (change(SPEED, np.negative, ALL[5]),), r"raise_empty\.csv.*sign looks inverted"),
    "only speed inverted": ("one", (change(SPEED, np.negative, *ONE),), "sign looks inverted"),
    "rpm under deg/s": ("arm", (change(SPEED, lambda x: x / 6, *ALL),), "revolutions per minute"),
    "gain of two": ("one", (NO_RANGE, change(SPEED, lambda x: 2 * x, *ONE)), "twice as large"),
    "lower and raise": ("arm", (exchange(*TRAIN[:2]),), r"(lower|raise)\.csv.*look exchanged"),
    "ms": ("arm", (change("time_s", lambda t: 1000 * t, *ALL),), "looks like milliseconds"),
    "once too long": ("arm", (change("time_s", lambda t: 10 * t, "raise.csv"),), r"raise\.csv.*ten times too long"),
    "ten times too short": ("arm", (change("time_s", lambda t: t / 10, *ALL),), "looks ten times too short"),
    "noise": ("arm", (noise("raise.csv"),), r"raise\.csv: the measured angular_velocity is noise"),
    "late": ("arm", (late(0.15, *ALL),), "clock looks 0.1[45].* s late"),
    "late once": ("arm", (late(0.1, "raise.csv"),), r"raise\.csv.*clock looks 0\.(09|10|1).* late"),
    "start is target": (
        "arm", (toml(("-8.0", "-99"), ("start_angle_deg = -48.0\ntarget_angle_deg = -99",
                                      "start_angle_deg = -8.0\ntarget_angle_deg = -48.0")),), r"short\.csv.*exchanged"),
    "angles in rad": ("arm", (angles_in_radians,), "every train.*start_angle_deg and target.* look given in radians"),
    "moving before the start": ("one", (late(-0.5, *ONE),), "not at rest before t = 0"),
    "same record held out": ("arm", (copied("raise.csv", "again.csv", "holdout"),), "raise.*again.*same 301 samples"),
    "g < 0": ("arm", (constant("g = -9.81"),), "'g' is -9.81 m/s2, a value from 0 to 30"),
    "milliohm": ("arm", (constant("R = 400.0"),), "'R' is 400 ohm"),
    "MPa": ("arm", (toml(more="\n[parameters]\np0 = { low = 2.6, high = 3.5 }\n"),),
            "p0: 2.6 to 3.5 is far outside the declared range"),
    "drive inverted": ("axis", (change("drive_N_m", np.negative, *AXIS),), "'u'.*sign looks inverted"),
    "drive inverted once": ("axis", (change("drive_N_m", np.negative, "fast.csv"),),
                            r"fast\.csv.*'u'.*sign.*disagree: one of the two is wrong"),
    "drive in mN m": ("axis", (change("drive_N_m", lambda u: 1000 * u, *AXIS),), "'u'.*1,000 times too large"),
    "axis: angle in rad": ("axis", (change("angle_deg", np.deg2rad, "slow.csv"),), r"slow.*moves 0\.017\d times"),
    "drives exchanged, friction": (
        "rubbing", (exchange_column("drive_N_m", *AXIS[:2]),), r"slow\.csv.*fast\.csv look exchanged"),
}  # fmt: skip


@pytest.fixture(scope="module")
def sparser(root, tmp_path_factory):
    """A folder with a sparser campaign of the arm, and one of one record."""
    folder = tmp_path_factory.mktemp("sparser")
    for kind, name in (("arm", "four_strokes"), ("one", "one_stroke")):
        shutil.copytree(root / "studies" / "campaigns" / name, folder / kind)
        for file in (folder / kind).glob("*.csv"):
            write_table(file, {n: v[::EVERY] for n, v in read_table(file, file.name).columns.items()})
    return folder


@pytest.fixture
def campaign(sparser, tmp_path):
    """Return a function that makes a fresh, sparser campaign: arm, one (one record), axis, rubbing (more friction)."""

    def made(kind):
        if kind in ("axis", "rubbing"):
            return pendulum(tmp_path / kind, friction=0.05 if kind == "rubbing" else 0.004)
        return shutil.copytree(sparser / kind, tmp_path / kind)

    return made


def said_of(folder):
    """Return every sentence that reading and screening a campaign gives."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            read = read_campaign(folder)
        except ArmidError as error:
            return [str(error)]
    model = read.model()
    found = data_issues(read, model, space_of(model, read.parameters))
    return [str(w.message) for w in caught] + [s.sentence for s in found]


def accusations(said):
    """Return what was said of records: that a machine without its friction is missed accuses none."""
    return [s for s in said if not s.endswith("look at its columns, and at what the model lacks.")]


def test_a_clock_is_moved_by_a_time_and_not_by_samples(campaign):
    """A record of few samples of which hardly any would be left stays as it is."""
    folder = campaign("arm")
    rewritten(lambda columns: {n: v[::10] for n, v in columns.items()}, "raise.csv")(folder)
    records = [r for r in read_campaign(folder).train if r.file in ("lower.csv", "raise.csv")]
    left = [moved(r, 0.2) for r in records]
    lost = [(r.n_samples - m.n_samples) * r.manoeuvre.interval for r, m in zip(records, left, strict=True)]
    assert lost == pytest.approx([0.2, 0.2])
    shift = round(0.2 / records[0].manoeuvre.interval)
    np.testing.assert_array_equal(left[0].seen, records[0].seen[shift:][: left[0].n_samples])
    assert moved(records[1], 5.0).pieces[0] is records[1].pieces[0]


@pytest.mark.slow
@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_noticed_and_named(name, campaign):
    kind, made, words = MISTAKES[name]
    folder = campaign(kind)
    for one in made:
        one(folder)
    said = said_of(folder)
    assert any(re.search(words, sentence) for sentence in said), said


# Right campaigns: effects that the declared model lacks, larger than usual, other sensors, few records, real noise.
LACKING = (
    "coulomb=80", "viscous=30", "tilt_deg=5", "worm_loss=0.8 worm_width=0.05", "flux_saturation=80",
    "supply_sag=0.015", "gas_heat_loss=1", "controller_delay=0.01", "gyro_bandwidth_hz=30 gyro_bias_deg_s=3",
    "rocking_hz=5", "coulomb=80 supply_sag=0.015 tilt_deg=3 viscous=20",
)  # fmt: skip
SENSORS = ("--noise-deg-s 5", "--noise-bandwidth-hz 40 --noise-deg-s 2", "--quantisation-deg-s 2", "--rest 1.0",
           "--holdout  --manoeuvres inside_E", "--repeats 3 --duration 0.4",
           "--noise-deg-s 0 --quantisation-deg-s 0")  # fmt: skip
# Few records, of which no majority says which are right.
PAIRS = ("lower,raise", "raise,short", "lower,empty,raise_empty")
COMMITTED = ("four_strokes", "one_stroke", "rocking_shell", "table1_stand/row_5")


@pytest.mark.nightly
def test_right_campaigns_are_not_accused(root, stand, tmp_path):
    options = [("--effect", *effects.split()) for effects in LACKING] + [text.split(" ") for text in SENSORS]
    options += [("--holdout", "", "--seed", str(4100 + i), "--manoeuvres", PAIRS[i % len(PAIRS)],
                 "--effect", *effects.split()) for i, effects in enumerate(LACKING[::3])]  # fmt: skip
    folders = [stand("--repeats", "1", "--duration", "0.8", *words) for words in options]
    folders += [root / "studies" / "campaigns" / name for name in COMMITTED]
    folders += [pendulum(tmp_path / f"p{i}", i, friction) for i, friction in enumerate((0.0, 0.03, 0.1))]
    shutil.copytree(root / "studies" / "campaigns" / "paper_arm", tmp_path / "arm")
    folders += [halves(pendulum(tmp_path / "parts"), ("window_s = [0, 1.5]", "window_s = [1.6, 3]")),
                halves(tmp_path / "arm", ("window_s = [0, 0.5]", "window_s = [0.6, 1]"))]  # fmt: skip
    assert len(folders) >= 30
    accused = {str(f): said for f in folders if (said := accusations(said_of(f)))}
    assert not accused, accused


def halves(folder, windows):
    """Return a campaign that names one recording twice, under two names and with windows that do not overlap."""
    file = next(folder.glob("s*.csv")).name
    copied(file, "second.csv", "train", more=windows[1])(folder)
    toml((f'file = "{file}"', f'file = "{file}"\n{windows[0]}'))(folder)
    return folder


@pytest.mark.nightly
def test_a_long_record_is_simulated_whole_only_to_learn_how_few_samples_will_do(campaign, monkeypatch):
    """Most of its motion comes after the samples that the checks begin with, and it is seen all the same."""
    folder, n, steps = campaign("one"), 200_000, []
    columns = dict(read_table(folder / "lower.csv", "lower.csv").columns)
    often = np.linspace(0.0, 0.7, n)
    measured = np.interp(often, columns["time_s"], columns[SPEED]) + np.random.default_rng(1).normal(0.0, 0.2, n)
    write_table(folder / "lower.csv", {"time_s": np.round(often, 9), SPEED: measured})
    run = Prepared.run

    def counted(self, population, *more, **named):
        steps.append(len(population) * self.n_samples * self.settings[3])
        return run(self, population, *more, **named)

    monkeypatch.setattr(Prepared, "run", counted)
    read = read_campaign(folder)
    points = list(check_campaign(read, dict(EFFECTS)))
    assert [point.sentence for point in points if not point.passed] == []
    # with all its samples one candidate in the middle, and once 8 others in steps of a quarter
    assert sum(steps) < 120 * n
    model = read.model()
    whole = shortened(read.train[0], 1)
    thinned = DataTrial(model, space_of(model, read.parameters)).thinned(whole, 1)
    assert (whole.n_samples, thinned.n_samples) == (n, 1 + n // 12)
    assert thinned.duration == pytest.approx(whole.duration, rel=1e-3)
    change(SPEED, np.negative, "lower.csv")(folder)
    assert any("sign looks inverted" in sentence for sentence in said_of(folder))


def test_what_the_declared_model_misses_cannot_be_judged(campaign):
    """A machine that the model cannot follow: check says so in place of `plausible`, and accuses nobody."""
    folder = campaign("one")
    change(SPEED, lambda x: x * (0.3 + 0.7 * np.sin(0.4 * np.arange(x.size))), *ONE)(folder)
    said = said_of(folder)
    assert len(said) == 1, said
    (sentence,) = said
    assert sentence.startswith("lower.csv: the declared model, fitted to the train records, leaves ")
    assert sentence.endswith("look at its columns, and at what the model lacks.")
    read = read_campaign(folder)
    (point,) = [p for p in check_campaign(read, dict(EFFECTS)) if p.name.startswith("plausible")]
    assert (point.name, point.passed, point.sentence) == ("plausible (unjudged)", True, sentence)
    assert point.unclear


def test_an_input_in_another_unit_than_is_typical_is_asked_about(campaign):
    """Of the records that are a hundred times below or above what the plant is typically driven by."""
    read = read_campaign(campaign("axis"))
    (driven,) = read.plant.inputs
    sizes = {r.file: max(np.max(np.abs(p.manoeuvre.inputs[driven.name])) for p in r.pieces) for r in read.records}

    def asked(typical):
        return list(far_from_typical(read, replace(read.plant, inputs=(replace(driven, typical=typical),))))

    assert asked(None) == asked((-3.0 * max(sizes.values()), 0.0)) == []
    for typical in ((-500.0 * max(sizes.values()), 0.0), (0.0, min(sizes.values()) / 500.0)):
        (point,) = asked(typical)
        assert (point.name, point.unclear) == (f"input {driven.name}", True)
        assert point.sentence.startswith(", ".join(sizes))


def test_check_and_identify_say_it(campaign, run):
    """Before anything is identified, and in the answer; check fails."""
    folder = campaign("one")
    change(SPEED, np.negative, *ONE)(folder)
    words = "every train record: the measured rad/s signal: its sign looks inverted"
    ran = run("check", folder)
    assert (ran.code, f"FAIL plausible (sign): {words}" in ran.out) == (1, True)
    with warnings.catch_warnings():
        warnings.simplefilter("default")
        told = run("identify", folder, "--budget", "80")
    assert told.code == 0
    assert f"armid: warning: {words}" in told.err
    assert words in " ".join(told.out.split())


def test_a_factor_of_two_has_to_leave_little():
    """A missing spring looks like an input that is told twice as large; so does no inverted sign."""
    halved = Correction("input", 0.5, "halved", lambda record: record)
    assert chosen("", 1.1, [(0.32, halved)]) == []
    assert [s.kind for s in chosen("", 1.1, [(0.15, halved)])] == ["input"]
    assert [s.kind for s in chosen("", 1.1, [(0.32, replace(halved, kind="sign", factor=-1.0))])] == ["sign"]
