"""Every bad input is refused with one sentence: file, line or key, what was found, what is expected."""

import os
import re

import numpy as np
import pytest

from armid.errors import ArmidError
from armid.record import read_campaign
from input_texts import LOWERING

HEADER = "time_s,angular_velocity_deg_s"
ROWS = [f"{i / 1000:.3f},{50 * np.sin(i / 10):.3f}" for i in range(-3, 60)]
ENTRY = f"\n{LOWERING}"
GOOD = f'name = "c00"\nplant = "shell_transfer_arm"\n{ENTRY}'


def csv(header=HEADER, rows=ROWS, **lines):
    """Return the text of a CSV file; `line_7="..."` puts other text into line 7 (the header is line 1)."""
    text = [header, *rows]
    for name, line in lines.items():
        text[int(name.removeprefix("line_")) - 1] = line
    return "\n".join(text) + "\n"


def refusal(folder):
    with pytest.raises(ArmidError) as caught:
        read_campaign(folder)
    message = str(caught.value)
    assert "\n" not in message
    assert len(message) < 400, message
    assert re.search("expected|did you mean|known:|there is none|expects|TOML", message), message
    return message


def assert_says(message, fragments):
    for fragment in fragments:
        assert fragment in message, message


CSV = {
    "missing speed": (csv("time_s,current_A"), ["campaign/lower.csv, line 1", "no speed column", "'current_A'",
                                                "angular_velocity_deg_s"]),
    "missing time": (csv("clock,angular_velocity_deg_s"), ["lower.csv, line 1", "no time column", "time_s"]),
    "unknown unit": (csv("time_s,angular_velocity_krpm"), ["lower.csv, line 1", "'angular_velocity_krpm'",
                                                           "unknown unit", "angular_velocity_rad_s"]),
    "counts of no encoder": (csv("time_s,angular_velocity_counts_s"), ["lower.csv, line 1", "counts_per_turn"]),
    "duplicate header": (csv("time_s,angular_velocity_deg_s,time_s", [r + ",1" for r in ROWS]),
                         ["lower.csv, line 1", "'time_s'", "twice"]),
    "no header": (csv("0.0,0.0"), ["lower.csv, line 1", "numbers are there, and no header", "a line of names"]),
    "NaN in most rows": (csv(rows=[r if i % 3 else f"{r.split(',')[0]},nan" if i % 2 else f"{r.split(',')[0]},"
                                   for i, r in enumerate(ROWS)][:2] + [f"{r.split(',')[0]},nan" for r in ROWS[2:]]),
                         ["lower.csv", "angular_velocity_deg_s has no number in 62 of 63 rows, the first on line 2",
                          "at most half"]),
    "NaN in the times": (csv(line_7="nan,2.0"), ["lower.csv, line 7", "time_s has no number there", "1 of 63"]),
    "inf": (csv(line_9="inf,1.0"), ["lower.csv, line 9", "time_s is inf", "finite"]),
    "text": (csv(line_12="0.007,fast"), ["lower.csv, line 12", "angular_velocity_deg_s is 'fast'", "number"]),
    "huge": (csv(line_12="0.007,1e200"), ["lower.csv, line 12", "1e+200", "within +-1e+30"]),
    "short row": (csv(line_20="0.015"), ["lower.csv, line 20", "1 values", "2 are expected as in the header"]),
    "spaces": (csv().replace(",", " "), ["lower.csv, line 1", "'time_s angular_velocity_deg_s'", "commas"]),
    "time goes back": (csv(line_30="0.001,3.0"), ["lower.csv, line 30", "time_s 0.001", "after 0.024", "increasing"]),
    "time twice": (csv(line_30="0.024,3.0"), ["lower.csv, line 30", "time_s 0.024", "twice", "increasing"]),
    "constant": (csv(rows=[f"{i / 1000},{np.sin(i) if i < 0 else 2.5}" for i in range(-60, 60)]),
                 ["lower.csv", "constant", "motion"]),
    "no samples": (csv(rows=[]), ["lower.csv", "no samples"]),
    "empty": ("", ["lower.csv, line 1", "empty", "header"]),
    "not UTF-8": (csv().encode().replace(b"angular", b"\xe4ngular"), ["lower.csv, line 1", "UTF-8"]),
    "a zip": (b"PK\x03\x04" + bytes(range(128)) * 20, ["lower.csv, line 1"]),
}  # fmt: skip


@pytest.mark.parametrize(("content", "fragments"), CSV.values(), ids=CSV.keys())
def test_csv(write, content, fragments):
    assert_says(refusal(write(GOOD, lower=content)), fragments)


TOML = {
    "misspelt campaign key": ('efects = ["coulomb"]\n' + GOOD, ["campaign.toml", "'efects'", "did you mean 'effects'"]),
    "misspelt record key": (GOOD.replace("target_angle_deg", "target_angel_deg"),
                            ["campaign.toml, record 'lower.csv'", "'target_angel_deg'", "mean 'target_angle_deg'"]),
    "campaign key in a record": (f'{GOOD}effects = ["coulomb"]\n',
                                 ["record 'lower.csv'", "'effects' is one of the campaign", "above the first [["]),
    "supply not said": (GOOD.replace("supply_V = 28.0", ""),
                        ["campaign/campaign.toml, record 'lower.csv'", "'supply_V' is missing", "U under [constants]"]),
    "no stroke": (GOOD.replace("22.0", "-48.0"), ["target_angle_deg is -48", "a motion is expected"]),
    "fixed and bounded": (GOOD.replace("[[records]]", "[parameters.n]\nlow = 1.0\nfixed = 1.4\n[[records]]"),
                          ["campaign/campaign.toml, parameters.n", "'fixed' and a bound", "expected"]),
    "missing records": ('name = "a"\nplant = "driven_axis"', ["campaign.toml", "'records'", "missing", "[[records]]"]),
    "missing file key": (GOOD.replace("file =", "# file ="), ["campaign.toml, record 1", "'file'", "missing"]),
    "unknown role": (GOOD.replace('"train"', '"test"'), ["'role' is 'test'", "'train' or 'holdout'"]),
    "no train record": (GOOD.replace('"train"', '"holdout"'), ["campaign.toml", "'train'", "at least one"]),
    "key below a table": ('[tolerances]\nV0 = 0.1\n' + GOOD, ["key 'name' stands under [tolerances], a line above"]),
    "no word of the shell": (GOOD.replace("shell = true", ""), ["'shell' is missing", "true or false"]),
    "text for a boolean": (GOOD.replace("shell = true", 'shell = "yes"'), ["'shell' is 'yes'", "true or false"]),
    "endless integer": (GOOD.replace("28.0", "9" * 5000), ["campaign.toml", "TOML"]),
    "endless hexadecimal": (GOOD.replace("28.0", "0x" + "f" * 9000), ["'supply_V'", "too many digits"]),
    "start outside travel": (GOOD.replace("-48.0", "-60.0"), ["'lower.csv'", "start_angle_deg is -60", "-55 to 45"]),
    "outside by a constant": (GOOD + "[records.constants]\ntheta_D = 1.0", ["target_angle_deg is 57.29", "-55 to 45"]),
    "unknown plant": (GOOD.replace("shell_transfer_arm", "shell_transfer_am"),
                      ["campaign.toml", "plant 'shell_transfer_am'", "did you mean 'shell_transfer_arm'"]),
    "effect twice": ('effects = ["coulomb", "coulomb"]\n' + GOOD, ["'coulomb'", "twice"]),
    "effect twice in two forms": ('effects = ["coulomb", "coulomb:tanh"]\n' + GOOD, ["'coulomb'", "twice"]),
    "unknown form": ('effects = ["coulomb:tan"]\n' + GOOD, ["campaign.toml", "'coulomb'", "did you mean 'tanh'"]),
    "unknown constant": (GOOD + "[records.constants]\nKp = 1.0", ["'Kp'", "did you mean 'K_p'"]),
    "unknown input": (GOOD + "[records.inputs]\nu = 'drive_V'", ["'u'", "not an input", "there is none"]),
    "restart of an arm": (GOOD + "restart_s = 1.0", ["'lower.csv'", "restart_s", "starts at rest"]),
    "window of one": (GOOD + "window_s = [0.7]", ["'window_s' is [0.7]", "[begin, end]"]),
    "unknown parameter": (GOOD + "[parameters.etta3]\nlow = 1.0", ["parameter 'etta3'", "did you mean 'eta3'"]),
    "a constant as a parameter": (GOOD + "[parameters.I01]\nlow = 1.0",
                                  ["campaign.toml: 'I01' under [parameters] is a constant", "[tolerances]"]),
    "crossed bounds": (GOOD + "[parameters.p0]\nlow = 3.2e6\nhigh = 3.1e6", ["parameters.p0", "3.2e+06", "low below"]),
    "low above the declared high": (GOOD + "[parameters.p0]\nlow = 5e6", ["parameters.p0", "5e+06", "3.5e+06"]),
    "repeat of nothing": (GOOD + 'repeat_of = "lowr.csv"', ["repeat_of 'lowr.csv'", "another record"]),
    "repeats in a circle": (
        GOOD + 'repeat_of = "b.csv"' + ENTRY.replace("lower.csv", "b.csv") + 'repeat_of = "lower.csv"',
        ["circle", "'lower.csv', 'b.csv', 'lower.csv'"],
    ),
    "same file twice": (GOOD + ENTRY, ["'lower.csv'", "two records"]),
    "missing file": (GOOD.replace("lower.csv", "lowre.csv"), ["'lowre.csv' does not exist", "mean 'lower.csv'"]),
    "absolute file": (GOOD.replace("lower.csv", "/etc/lower.csv"), ["'/etc/lower.csv'", "out of the campaign"]),
    "file above": (GOOD.replace("lower.csv", "../lower.csv"), ["out of the campaign"]),
    "file above, round about": (GOOD.replace("lower.csv", "sub/../../lower.csv"), ["out of the campaign"]),
    "file above, of Windows": (GOOD.replace("lower.csv", "..\\\\lower.csv"), ["lower.csv'"]),
    "file of a drive": (GOOD.replace("lower.csv", "C:\\\\lower.csv"), ["lower.csv'"]),
    "zero in the name": (GOOD.replace("lower.csv", "lower\\u0000.csv"), ["CSV file"]),
    "broken TOML": (GOOD.replace("shell = true", "shell = = true"), ["campaign.toml", "not valid TOML", "line 9"]),
    "text without quotes": ('name = a\nplant = "driven_axis"', ["line 1", "text stands in quotes, name = 'a'"]),
    "binary TOML": (b"\xff\xfe\x00\x01", ["campaign.toml, line 1", "UTF-8"]),
    "deep TOML": ("a = " + "[" * 5000, ["campaign.toml", "TOML"]),
    "deep tables": (GOOD + "[records.constants." + ".".join("a" * 3000) + "]", ["'constants.a'", "finite number"]),
}  # fmt: skip


@pytest.mark.parametrize(("toml", "fragments"), TOML.values(), ids=TOML.keys())
def test_toml(write, toml, fragments):
    # tables of the campaign stand before its records in TOML, whatever order the table above is easier to read in
    assert_says(refusal(write(toml, lower=csv())), fragments)


@pytest.mark.parametrize(("step", "sign"), [(0.01, 1), (0.5, -1)])
def test_saturation(write, arm_columns, step, sign):
    speed = np.clip(sign * np.round(arm_columns["angular_velocity_deg_s"] * 3 / step) * step, -200, 200)
    assert np.sum(np.abs(speed) == 200) > 5
    # within one step of the range is at the range
    at_range = np.flatnonzero(np.abs(speed) == 200)
    speed[at_range[::2]] -= sign * step
    message = refusal(write("gyro_range_deg_s = 200\n" + GOOD, lower={**arm_columns, "angular_velocity_deg_s": speed}))
    assert_says(message, ["lower.csv, line", "5 samples in a row", "200 deg/s", "saturated"])
    line = int(re.search(r"line (\d+)", message).group(1))
    assert abs(speed[line - 2]) >= 200 - 1.001 * step > abs(speed[line - 3])


def test_other_than_a_campaign_links_out_of_its_folder_and_units_that_differ(write, tmp_path):
    folder = write(GOOD, lower=csv())
    assert read_campaign(folder).records[0].n_samples == 60
    assert_says(refusal(tmp_path / "nothing"), ["nothing' does not exist", "campaign.toml"])
    assert_says(refusal(tmp_path), ["holds no campaign.toml"])
    assert_says(refusal(folder / "lower.csv"), ["lower.csv' is a record", "campaign.toml is expected"])
    assert_says(refusal("a\0b"), ["does not exist"])
    (folder / "lower.csv").rename(tmp_path / "outside.csv")
    os.symlink(tmp_path / "outside.csv", folder / "lower.csv")
    assert_says(refusal(folder), ["'lower.csv'", "links out of the campaign's folder"])
    (folder / "lower.csv").unlink()
    os.symlink("lower.csv", folder / "lower.csv")
    assert_says(refusal(folder), ["'lower.csv' does not exist"])
    (folder / "lower.csv").unlink()
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "outside.csv").rename(tmp_path / "elsewhere" / "lower.csv")
    (folder / "linked").symlink_to(tmp_path / "elsewhere")
    folder = write(GOOD.replace("lower.csv", "linked/lower.csv"), other="")
    assert_says(refusal(folder), ["'linked/lower.csv'", "links out of the campaign's folder"])
    second = ENTRY.replace("lower.csv", "second.csv")
    toml = GOOD.replace("shell_transfer_arm", "driven_axis").split("[[records]]")[0]
    toml += '[[records]]\nfile="lower.csv"\nrole="train"\n[[records]]\nfile="second.csv"\nrole="holdout"\n'
    drive = [r + ",1" for r in ROWS]
    linear = csv("time_s,velocity_m_s,drive_V", drive)
    folder = write(toml, lower=csv(HEADER + ",drive_N_m", drive), second=linear)
    assert_says(refusal(folder), ["second.csv", "m/s", "rad/s is expected", "lower.csv"])
    folder = write(GOOD + second, lower=csv(), second=csv("time_s,velocity_m_s"))
    assert_says(refusal(folder), ["second.csv, line 1", "m/s", "shell_transfer_arm"])


def test_what_is_too_large_or_counts_nowhere(write, tmp_path):
    """Each in one sentence that names the place and is short."""
    long, file = "x" * 11_000_000, tmp_path / "campaign" / "lower.csv"
    with pytest.raises(ArmidError, match=r"campaign\.toml has 11 MB, at most 2 MB of TOML are expected"):
        read_campaign(write(f"{GOOD}note = '{long}'\n"))
    with pytest.raises(ArmidError, match=r"line 4: 100,001 dots on one line .*, shorter lines are expected"):
        read_campaign(write(f"a = 1\n\n\n{'a.' * 100_000}b.c = 1\n{GOOD}"))
    with pytest.raises(ArmidError, match=r"'records' is a list of 10,001, 1 to 10,000 tables headed \[\[records\]\]"):
        read_campaign(write(GOOD + '[[records]]\nfile = "lower.csv"\n' * 10_000))
    with pytest.raises(ArmidError, match=r"lower\.csv, line 1: the header has more than 65536 characters"):
        read_campaign(write(GOOD, lower="time_s," + "x" * 70_000 + "\n0,1\n"))
    own = "[constants]\nU = 27.0\n[[records]]"
    with pytest.warns(UserWarning, match=r"constant 'U' counts nowhere, since every record sets its own"):
        read_campaign(write(GOOD.replace("[[records]]", own), lower=csv()))
    with pytest.raises(ArmidError) as refused:
        read_campaign(write(GOOD + '[parameters."qqq.zzz"]\nlow = 0.0\n', lower=csv()))
    assert re.search(r"known: \S+, \S+, \S+ and \d+ more", str(refused.value))
    assert len(str(refused.value)) < 300
    file.unlink()
    file.symlink_to("nowhere.csv")
    with pytest.raises(ArmidError, match=r"file 'lower\.csv' does not exist: a folder or a dead link"):
        read_campaign(tmp_path / "campaign")
