"""`armid list`, `check`, `bench`, `import`, `new`, help and exit codes."""

import json
import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path
from warnings import catch_warnings, simplefilter

import pytest
from click.shell_completion import ShellComplete

from armid.cli.main import Commands, app
from armid.cli.new import NEW_KINDS
from armid.model import EFFECTS
from armid.study.runner import TIME_LIMIT_S

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.usefixtures("in_a_folder")


def test_list_effects(run):
    ran = run("list", "effects", "--long")
    assert (ran.code, ran.err) == (0, "")
    assert re.findall(r"^(\w+): ", ran.out, re.MULTILINE) == list(EFFECTS)
    assert max(map(len, ran.out.splitlines())) <= 80
    assert "port torque += -level * omega / sqrt(omega ** 2 + width ** 2)" in ran.out
    assert "level [effort] from 0 to 0.5, null 0" in ran.out
    on_all = "on shell_transfer_arm, driven_axis, shell_transfer_arm_elastic, flexible_link, rotary_arm"
    assert on_all in " ".join(ran.out.split())
    assert re.search(r"^flux_sat.*\n  in the form rational\n(.*\n)*  in the form arctangent\n", ran.out, re.MULTILINE)


def test_list_plants_and_an_effect_of_the_sensor_of_one(run):
    text = run("list", "plants", "--long").out.replace("\n      ", " ")
    assert "flexible_link (recorded in rad, rad, rad/s, rad/s)" in text
    for line in ("parameter p0 [Pa] from 2.6e+06 to 3.5e+06", "state omega [rad/s]", "port feedback [rad/s]",
                 "constant I6_loaded = 64 kg m2", "key supply_V sets U", "input u [V, N or N m] from drive_V or",
                 "I is another name for current"):  # fmt: skip
        assert line in text
    text = run("list", "effects", "hub_angle_scale").out
    assert "hub_angle_scale: error of hub_angle in proportion to it" in text
    assert text.rstrip().endswith("on flexible_link")


@pytest.mark.parametrize(("what", "name", "line"), [
    ("effects", "cubic_drag", "port torque += -c * omega ** 3"),
    ("fitness", "largest_miss", "largest_miss: a function of the user (records join by duration)"),
    ("identifiers", "evolution", "evolution: a function of the user"),
])  # fmt: skip
def test_a_user_s_things_are_listed(run, mine, what, name, line):
    assert line in run("list", what, name, "--long", "--plugin", f"{mine}:{name}").out
    assert name in run("list", what, "--plugin", f"{mine}:{name}").out


def test_a_list_is_a_table_and_a_name_says_more(run, refused):
    for what in ("effects", "plants", "fitness", "identifiers", "analyses"):
        names = run("list", what, "--quiet").out.split()
        table = run("list", what).out
        assert table.startswith(f"{len(names)} {what}; `armid list {what} NAME` says more.\n")
        assert all(re.search(rf"^│ {name} ", table, re.MULTILINE) for name in names)
        assert " += " not in table
        one = run("list", what, names[-1]).out
        assert one.startswith(names[-1])
        assert json.loads(run("list", what, names[-1], "--json").out)[what].keys() == {names[-1]}
    assert "port torque\n" in run("list", "effects", "coulomb").out
    assert "port torque += -level" in run("list", "effects", "coulomb", "viscous", "--long").out
    delayed = run("list", "effects", "drive_delay", "--long").out
    assert "port winding += late - voltage" in delayed
    assert "port drive += late - drive_effort" in delayed
    assert "did you mean 'coulomb'" in refused("list", "effects", "colomb")


@pytest.mark.parametrize(("words", "begun", "found"), [
    (["list"], "eff", {"effects"}), (["list", "effects"], "coul", {"coulomb"}),
    (["identify", "x", "--identifier"], "lsh", {"lshade"}), (["identify", "x", "--fitness"], "rm", {"rmse"}),
    (["identify", "x", "--effects"], "viscous,coul", {"viscous,coulomb"}), (["new"], "st", {"study"}),
    (["close-loop", "x", "--candidates"], "coul", {"coulomb"}), (["schema"], "", {"campaign", "study"}),
    (["check", "x", "--on"], "flex", {"flexible_link"}), (["simulate", "x", "--accuracy"], "f", {"fine"}),
    (["identifiability", "x", "--rank"], "w", {"worst"}),
])  # fmt: skip
def test_the_shell_completes_values(words, begun, found):
    completed = ShellComplete(app, {}, "armid", "_ARMID_COMPLETE").get_completions(words, begun)
    assert {item.value for item in completed} == found


def test_bench_prints_one_table_and_an_installed_package_has_none(run, monkeypatch, tmp_path):
    from bench import run as bench
    from bench.measure import Row

    monkeypatch.setattr(bench, "bench_parts", lambda *_: {"fitness": lambda: Row("fitness", 3.8, "us")})
    ran = run("bench", "--quick")
    assert ran.code == 0
    assert re.match(r"what +measured +ratio +of +wanted +met", ran.out)
    assert "bench" in Commands("armid").list_commands(None)
    monkeypatch.setattr("armid.cli.main.STUDIES", tmp_path / "studies")
    installed = Commands("armid")
    assert "bench" not in installed.list_commands(None)
    assert installed.get_command(None, "bench") is None


def test_help_tells_every_option(run, every_command):
    for words in ((), *every_command):
        ran = run(*words, "--help")
        assert (ran.code, ran.err) == (0, "")
        assert ran.out.startswith("Usage: armid ")
        assert all(len(line) <= 110 for line in ran.out.splitlines())
        parameters = every_command[words].params if words else ()
        options = {name for p in parameters for name in p.opts if name.startswith("--")}
        assert {option for option in options if not re.search(rf"{option}\b", ran.out)} == set(), words
        if "--plugin" in options:
            text = " ".join(ran.out.split())
            assert "--plugin FILE.py:attribute" in text
            assert "This runs the Python code of the file" in text
    assert f"[default: ({TIME_LIMIT_S:g})]" in " ".join(run("study", "--help").out.split())
    assert run("-h").out == run("--help").out
    assert "..." not in run("--help").out.partition("Commands:")[2]


def test_without_a_command_the_help_is_shown_and_the_version_is_told(run):
    ran = run()
    assert ran.code == 2
    assert "Commands:" in ran.out + ran.err
    assert re.fullmatch(r"armid, version \d+\.\d+\.\d+\n", run("--version").out)


@pytest.mark.slow
def test_a_reader_that_leaves_changes_nothing_but_what_he_reads(small_folder, root, tmp_path):
    """As `| head -1` leaves, and `2>&1 | head -1`: what was computed is saved, and the exit code stays."""
    out = tmp_path / "out"
    quick = ("--window", "0:0.4", "--budget", "80", "--identifier", "random", "--out", out)
    for call in (("list", "plants", "--json"), ("identify", small_folder, *quick)):
        command = [sys.executable, "-m", "armid", *map(str, call)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=root) as process:
            process.stdout.close()
            told = [line for line in process.stderr if not line.startswith(b"armid: compiling")]
        assert (process.returncode, told) == (0, []), call
        assert out not in call or (out / "report.html").stat().st_size > 0, call
        (out / "report.html").unlink(missing_ok=True)
    for told in (["--help"], []):
        asked = [sys.executable, "-m", "armid", *told]
        with subprocess.Popen(asked, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
            process.stdout.close()
            assert process.stderr.read() == b""
        assert process.returncode == (0 if told else 2), told
    command = [sys.executable, "-m", "armid", "report", str(out)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, cwd=root) as process:
        process.stdout.close()
    assert (process.returncode, (out / "report.html").is_file()) == (0, True)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full here, a file that is always full")
def test_an_output_that_is_full_is_one_sentence():
    for words in (["--help"], ["list", "plants", "--json"]):
        asked = [sys.executable, "-m", "armid", *words]
        with open("/dev/full", "wb") as full:
            said = subprocess.run(asked, check=False, stdout=full, stderr=subprocess.PIPE, text=True)
        assert said.returncode == 2, words
        assert said.stderr == "armid: the standard output cannot be written: No space left on device\n", words


def test_every_command_tells_an_example_that_exists(every_command):
    epilogs = {words: (command.epilog or "").splitlines()[2:] for words, command in every_command.items()}
    assert [words for words, lines in epilogs.items() if not lines] in ([], [("export", "reports")])
    for line in (line.strip().split("  ")[0] for lines in epilogs.values() for line in lines):
        said = shlex.split(line)
        own = next(w for w in every_command if tuple(said[1 : 1 + len(w)]) == w)
        known = {name for parameter in every_command[own].params for name in parameter.opts}
        assert {word for word in said if word.startswith("--")} <= known, line
        for word in said:
            assert not word.startswith("studies/") or (ROOT / word).exists() or word.endswith(("emps", "dfki")), line


@pytest.mark.slow
def test_new_files_serve_at_once(run):
    run("new", "campaign", "axis")
    words = []
    for kind, option in (("fitness", "--fitness"), ("identifier", "--identifier"), ("effect", "--effects")):
        run("new", kind, f"my_{kind}")
        words += ["--plugin", f"my_{kind}.py:my_{kind}", option, f"my_{kind}"]
    ran = run("identify", "axis", *words, "--budget", "160")
    assert (ran.code, ran.err) == (0, "")


@pytest.mark.slow
def test_a_campaign_is_read_moves_and_says_that_it_is_synthetic(run, tmp_path):
    made = run("new", "campaign", "my_axis")
    assert (made.code, made.out) == (0, "wrote my_axis; try: armid check my_axis\n")
    checked = run("check", "my_axis")
    assert checked.code == 0
    assert re.search(r"^(\d+) of \1 points hold$", checked.out, re.MULTILINE)
    path = tmp_path / "my_axis" / "campaign.toml"
    text = path.read_text()
    assert text.startswith("# SYNTHETIC: no machine was measured.")
    assert "constants: taken as exact: gain;" in checked.out
    path.write_text(text.replace("# [tolerances]\n# default", "[tolerances]\ndefault"))
    assert "taken as exact" not in run("check", "my_axis").out
    path.write_text(text)
    files = [r["file"] for r in tomllib.loads(text)["records"]]
    assert files == ["synthetic_train.csv", "synthetic_holdout.csv"]


def test_nothing_is_overwritten_nor_written_through_a_link_that_leads_nowhere(run, refused, tmp_path):
    for kind in NEW_KINDS:
        assert run("new", kind, "mine", "--out", kind).code == 0
        before = {p: p.read_bytes() for p in tmp_path.rglob("*") if p.is_file()}
        assert "exists already" in refused("new", kind, "mine", "--out", kind)
        assert {p: p.read_bytes() for p in tmp_path.rglob("*") if p.is_file()} == before
    (tmp_path / "mine.py").symlink_to(tmp_path / "elsewhere.py")
    assert "mine.py exists already" in refused("new", "effect", "mine")
    assert not (tmp_path / "elsewhere.py").exists()


def test_check_takes_a_campaign_and_tells_what_does_not_hold(run, refused, tmp_path):
    assert "campaign 'nowhere' does not exist" in refused("check", "nowhere")
    run("new", "campaign", "my_axis")
    toml = tmp_path / "my_axis" / "campaign.toml"
    text = toml.read_text()
    toml.write_text(text + "[parameters.inertia]\nfixed = 1e-25\n")
    with catch_warnings():
        simplefilter("default")
        ran = run("check", toml)
    assert ran.code == 1
    assert "far outside the declared range" in ran.err
    assert "FAIL moves in synthetic_train.csv: its simulation diverges" in ran.out
    toml.write_text(text.replace('# effects = ["viscous"]', 'effects = ["gas_heat_loss"]'))
    ran = run("check", toml)
    assert ran.code == 1
    assert "FAIL model: effect 'gas_heat_loss'" in ran.out


def test_a_search_of_one_s_own_is_a_function(run, refused, tmp_path):
    assert run("new", "identifier", "annealing", "--style", "function", "--out", tmp_path).code == 0
    assert len((tmp_path / "annealing.py").read_text().partition("\ndef ")[2].splitlines()) <= 10
    ran = run("check", f"{tmp_path}/annealing.py:annealing")
    assert (ran.code, "9 of 9 points hold" in ran.out) == (0, True)
    said = refused("new", "effect", "drag", "--style", "function", "--out", tmp_path)
    assert "an identifier has the style 'function'" in said
