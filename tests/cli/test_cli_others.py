"""`armid list`, `check`, `bench`, `import`, help and exit codes."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from armid.model import EFFECTS

ROOT = Path(__file__).parents[2]


def test_list_effects(run):
    ran = run("list", "effects")
    assert (ran.code, ran.err) == (0, "")
    assert re.findall(r"^(\w+): ", ran.out, re.MULTILINE) == list(EFFECTS)
    assert max(map(len, ran.out.splitlines())) <= 110
    assert ran.out.count("  source: ") >= len(EFFECTS)
    assert "port torque += -level * omega / sqrt(omega ** 2 + width ** 2)" in ran.out
    assert "level [effort] from 0 to 0.5, null 0" in ran.out
    assert "fixed at 0.005 unless bounds free it" in ran.out
    assert "source: doi:10.1016/0005-1098(94)90209-7" in ran.out
    assert "on shell_transfer_arm, driven_axis\n" in ran.out
    assert re.search(r"^flux_sat.*\n  in the form rational\n(.*\n)*  in the form arctangent\n", ran.out, re.MULTILINE)


def test_list_plants(run):
    text = run("list", "plants").out
    headed = re.findall(r"^(\w+) \(recorded in (rad/s|m/s)\)", text, re.MULTILINE)
    assert headed == [("shell_transfer_arm", "rad/s"), ("driven_axis", "m/s"), ("driven_axis", "rad/s")]
    assert text.count("estimate (REF), not published") >= 25
    for line in ("parameter p0 [Pa] from 2.6e+06 to 3.5e+06", "state omega [rad/s]", "port feedback [rad/s]",
                 "constant I6_loaded = 64 kg m2", "key supply_V sets U", "input u [V, N or N m] from drive_V or",
                 "I is another name for current"):  # fmt: skip
        assert line in text


def test_list_fitness_and_identifiers(run):
    names = re.findall(r"^(\w+): .* \(records join by (\w+)\)$", run("list", "fitness").out, re.MULTILINE)
    assert dict(names) == {"similarity": "duration", "numerical_similarity": "duration",
                           "shape_similarity": "duration", "rmse": "samples", "nrmse": "samples",
                           "likelihood": "sum"}  # fmt: skip
    identifiers = run("list", "identifiers").out
    assert re.search(r"^pso: the paper's particle swarm .*\(global, stochastic\)$", identifiers, re.MULTILINE)
    assert "(local, gradient, stochastic, rmse or likelihood)" in identifiers


@pytest.mark.parametrize(("what", "name", "line"), [
    ("effects", "cubic_drag", "port torque += -c * omega ** 3"),
    ("fitness", "largest_miss", "largest_miss: a function of the user (records join by duration)"),
    ("identifiers", "evolution", "evolution: a function of the user"),
])  # fmt: skip
def test_a_user_s_things_are_listed(run, mine, what, name, line):
    assert line in run("list", what, "--plugin", f"{mine}:{name}").out


@pytest.mark.parametrize("name", [pytest.param("cubic_drag", marks=pytest.mark.slow), "largest_miss", "evolution"])
def test_check_runs_the_contract(run, mine, name):
    ran = run("check", f"{mine}:{name}")
    assert ran.code == 0
    assert re.search(r"^(\d+) of \1 points hold$", ran.out, re.MULTILINE)
    assert "FAIL" not in ran.out


def test_check_tells_what_does_not_hold(run, mine):
    ran = run("check", f"{mine}:diverging")
    assert ran.code == 1
    assert "FAIL" in ran.out


@pytest.mark.slow
def test_bench_prints_one_table(run):
    ran = run("bench", "--quick")
    assert ran.code == 0
    assert re.match(r"what +measured +ratio +of +wanted +met", ran.out)


def test_import_makes_a_campaign_that_can_be_identified(run, tmp_path):
    from scipy.io import savemat

    times = np.arange(2000)[:, np.newaxis] / 1000.0
    position = 0.1 * (1.0 - np.cos(2 * np.pi * times)) / (2 * np.pi)
    drive = 2.0 * np.pi * np.cos(2 * np.pi * times) * 0.1 / 4.0
    for name in ("DATA_EMPS", "DATA_EMPS_PULSES"):
        savemat(tmp_path / f"{name}.mat", {"t": times, "qm": position, "vir": drive, "gtau": 40.0})
    ran = run("import", "emps", tmp_path, "--out", tmp_path / "campaign")
    assert (ran.code, ran.out) == (0, f"wrote {tmp_path / 'campaign'}\n")
    found = run("identify", tmp_path / "campaign", "--fitness", "rmse", "--bounds", "mass=1:20", "--budget", "800")
    # force over acceleration, 40 N/V x 0.05 pi V over 0.2 pi m/s2
    assert float(re.search(r"mass +│ ([\d.]+) +│ kg", found.out)[1]) == pytest.approx(10.0, rel=0.01)


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
    assert run("-h").out == run("--help").out
    assert "..." not in run("--help").out.partition("Commands:")[2]


def test_without_a_command_the_help_is_shown(run):
    ran = run()
    assert ran.code == 2
    assert "Commands:" in ran.out + ran.err


def test_version(run):
    assert re.fullmatch(r"armid, version \d+\.\d+\.\d+\n", run("--version").out)


def test_runs_as_a_module_and_its_errors_set_the_exit_code(other_process):
    good, bad = other_process("list", "identifiers"), other_process("identify", "nowhere")
    assert (good.returncode, good.stderr) == (0, "")
    assert (bad.returncode, bad.stdout) == (2, "")
    assert bad.stderr.startswith("armid: campaign 'nowhere' does not exist")
    assert "Traceback" not in bad.stderr


def test_a_reader_that_leaves_is_no_error_of_ours(root):
    command = [sys.executable, "-m", "armid", "list", "plants"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=root) as process:
        process.stdout.close()
        assert b"Traceback" not in process.stderr.read()


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
