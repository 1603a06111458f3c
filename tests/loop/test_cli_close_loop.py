"""`armid close-loop` as a user meets it."""

import json
import re
import shutil

import numpy as np
import pytest
from few_candidates import CANDIDATES, COMMON

from armid.estimation.least_squares import descend
from armid.model import EFFECTS
from commands import ended

IN_ONE_THREAD = ("--candidates", "viscous,drive_gain", "--threads", 1)


@pytest.mark.slow
def test_report_table_and_figures_are_written(stand, tmp_path, capsys):
    campaign = shutil.copytree(stand(*COMMON, "--effect", "supply_sag=0.010"), tmp_path / "campaign")
    with (campaign / "campaign.toml").open("a") as file:
        file.write("R = 0.001\n")
    assert ended("close-loop", campaign, "--out", tmp_path / "out", "--candidates", ",".join(CANDIDATES)) == 0
    printed = capsys.readouterr().out
    assert "supply_sag" in printed
    assert "verdict: explained" in printed
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert report["version"] == 2
    assert report["effects"] == ["supply_sag"]
    assert report["probabilities"]["effects"]["supply_sag"] > 0.99
    text = (tmp_path / "out" / "report.md").read_text()
    figures = ["motion.png", "residuals.png", "diagnosis.png", "probabilities.png", "intervals.png", "parameters.png",
               "against.png", "autocorrelation.png"]  # fmt: skip
    for name in figures:
        assert f"]({name})" in text
        assert (tmp_path / "out" / name).stat().st_size > 10_000
    page = (tmp_path / "out" / "report.html").read_text()
    # stored ones, and one for each of the five records
    assert page.count("<svg") == 7 + 5
    for wanted in ("Explained: The declared model lacked supply_sag", "+     supply_sag.supply = ", "armid close-loop ",
                   "How probable each is", "Error on the records held out"):  # fmt: skip
        assert wanted in page, wanted
    # what leads is the same sentence everywhere
    led = f"nothing missing 0.00; something that the library does not hold 0.00 (among 5 of {len(EFFECTS)} effects)."
    said = re.search(rf"supply_sag 1\.00; .*?{re.escape(led)}", " ".join(printed.split()))
    for whole in (text, page):
        assert said.group() in whole
    assert ended("report", tmp_path / "out") == 0
    assert (tmp_path / "out" / "report.html").read_text() == page


@pytest.fixture(scope="module")
def whole(write_axis, axis_speed, tmp_path_factory):
    """A loop that finds an effect, closed in one thread: its campaign, its report, and how many fits it made."""
    folder, made = tmp_path_factory.mktemp("whole"), []
    speed = axis_speed(np.arange(401) / 200.0) + 1e-3 * np.random.default_rng(1).standard_normal(401)
    campaign, out = write_axis(folder / "axis", speed), folder / "out"

    def counted(*given, **options):
        made.append(given)
        return descend(*given, **options)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("armid.inference.model.descend", counted)
        assert ended("close-loop", campaign, "--out", out, *IN_ONE_THREAD) == 0
    assert not (out / "progress.jsonl").exists()
    return campaign, (out / "report.json").read_bytes(), len(made)


@pytest.mark.slow
def test_the_result_is_the_same_on_any_number_of_threads(whole, tmp_path):
    campaign, report, _ = whole
    assert ended("close-loop", campaign, "--out", tmp_path, *IN_ONE_THREAD[:-1], 3) == 0
    assert (tmp_path / "report.json").read_bytes() == report
    assert json.loads(report)["effects"] == ["viscous"]


@pytest.mark.slow
def test_what_is_cut_off_goes_on_from_its_fits_to_the_same_result(whole, tmp_path, monkeypatch, capsys):
    campaign, report, n_whole = whole
    made = []

    def counted(*given, **options):
        if len(made) == stop_at:
            raise KeyboardInterrupt
        made.append(given)
        return descend(*given, **options)

    monkeypatch.setattr("armid.inference.model.descend", counted)
    stop_at = n_whole - 5
    assert ended("close-loop", campaign, "--out", tmp_path, *IN_ONE_THREAD) == 130
    kept = tmp_path / "progress.jsonl"
    assert f"kept in {kept}: the same command goes on" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == [kept]
    lines = kept.read_text().splitlines()
    assert len(lines) == stop_at
    # the last line was being written, others come from elsewhere
    kept.write_bytes("\n".join(["5", '["a", 3]', *lines[:-1], lines[-1][:20]]).encode() + b"\xff")

    made.clear()
    stop_at = None
    assert ended("close-loop", campaign, "--out", tmp_path, *IN_ONE_THREAD) == 0
    assert len(made) == 5 + 1
    assert not kept.exists()
    assert (tmp_path / "report.json").read_bytes() == report
