"""Folders as the commands write them, with numbers that nobody computed: they test pages, and claim nothing."""

import json

import numpy as np
from pandas import DataFrame

from armid.report.document import Column, Document, Section, Table, listing

EVIL = '<script>document.title="broken"</script><img src=x onerror=alert(1)>"\'&[x](javascript:alert(1)) [/x]'
SVG = """<?xml version="1.0"?>
<!DOCTYPE svg PUBLIC "-//W3C//DTD SVG 1.1//EN" "http://www.w3.org/Graphics/SVG/1.1/DTD/svg11.dtd">
<svg xmlns:xlink="http://www.w3.org/1999/xlink" width="450pt" height="225pt" viewBox="0 0 450 225"
 xmlns="http://www.w3.org/2000/svg"><metadata><date>today</date></metadata>
<defs><clipPath id="c1"><rect x="0" y="0" width="450" height="225"/></clipPath>
<path id="m1" d="M 0 0 L 3.14159 3"/></defs>
<g id="unused"><path d="M 0.123456 10 L 450 200" clip-path="url(#c1)" style="fill: none; stroke: #0072b2"/></g>
<use xlink:href="#m1" x="10.98765" y="20"/></svg>"""


def errors(rmse):
    return {"rmse": rmse, "nrmse": 0.01, "chi2_per_sample": 2.0, "s": 0.99, "s1": 0.98, "s2": 1.0}


def parameter(value, unit="1", sure=True, cause="noise"):
    return {"value": value, "unit": unit, "low": 0.9 * value, "high": 1.1 * value, "trusted": sure,
            "interval_holds": sure, "noise_low": 0.95 * value, "noise_high": 1.05 * value,
            "causes": [f"{cause}, 80%"]}  # fmt: skip


def curve(n, size):
    x = np.linspace(0.0, 1.2, n)
    return {"x": list(x), "y": list(size * np.sin(9.0 * x))}


def made_by(command):
    return {"command": command, "settings": {"seed": 1, "plugins": [], "window": ""}}


def loop_report(name="arm"):
    """Return report.json of a loop that has added one effect."""
    before = {"p0": parameter(3.1e6, "Pa", False), "n": parameter(1.3, sure=False)}
    after = {"p0": parameter(3.0e6, "Pa", cause=name), "n": parameter(1.4), f"{name}_x.level": parameter(40.0, "N m")}
    step = {"effect": f"{name}_x", "port": "torque", "alternatives": ["other"], "empirical": False, "claimed": False,
            "instead": {}, "probability": 0.5, "error": {"train": errors(0.005), "holdout": errors(0.006)},
            "parameters": after}  # fmt: skip
    chances = {"effects": {f"{name}_x": 0.5, "other": 0.45}, "effects_beside_unknown": {}, "sets": [],
               "nothing": 0.01, "unknown": 0.04, "records": {f"late@{name}.csv": 0.02}, "drifts": {},
               "constants": {}, "among": [5, 38]}  # fmt: skip
    return {
        "version": 2, "probabilities": chances,
        "campaign": name, "plant": "shell_transfer_arm", "unit": "rad/s", "noise_rms": 0.004,
        "outputs": {"speed": {"unit": "rad/s", "noise_rms": 0.004, "moved_by_inputs": 0.0}},
        "noise_rms_holdout": None, "also": [], "next_steps": [], "known_together": [], "taken_as_exact": [],
        "verdict": "cannot_tell_apart", "effects": [f"{name}_x"],
        "error": {"before": {"train": errors(0.02), "holdout": errors(0.03)}, "after": step["error"]},
        "parameters": {"before": before, "after": after}, "steps": [step],
        "advice": [{"manoeuvre": {"supply_V": 24.0}, "separates": [f"{name}_x", "other"], "power": 0.8}],
        "log": [{"hypotheses": [f"{name}_x"], "log_probability": 0.0, "chi2_per_sample": 1.01},
                {"hypotheses": [], "log_probability": -40.0, "chi2_per_sample": 2.5}],
    }  # fmt: skip


def loop_details(name="arm", n_records=2, n_points=300):
    record = {"role": "train", "unit": "rad/s", "n_samples": n_points, "noise_rms": 0.004,
              "error": {"before": errors(0.02), "after": errors(0.005)},
              "curves": {"before": curve(n_points, 0.03), "after": curve(n_points, 0.004)}}  # fmt: skip
    own = {"p0": {"value": 3.0e6, "low": 2.9e6, "high": 3.1e6}}
    models = [{"model": f"{name}_x", "probability": 0.5, "parameters": own}]
    return {
        "made_by": made_by(f"armid close-loop {name}"), "versions": {"armid": "0"},
        "headline": "Effects cannot be told apart", "conclusion": f"It lacks {name}.",
        "shifts": [f"{name} was bent"], "doubts": [],
        "diagnosis": {"before": {"train": [f"More than noise in {name}."], "holdout": None}, "after": None},
        "missing": [], "equations": {"before": f"{name}\n  torque = 0", "after": f"{name} + x\n  torque = x\n  end"},
        "records": [{"file": f"{name}_{i}.csv", "record": f"{name}_{i}.csv", **record} for i in range(n_records)],
        "n_records": n_records + 1, "n_files": n_records + 1, "suspects": [],
        "models": models, "advice": [f"lower {name}"],
    }  # fmt: skip


def write_loop(folder, name="arm", figures=True):
    folder.mkdir()
    (folder / "report.json").write_text(json.dumps(loop_report(name)))
    (folder / "details.json").write_text(json.dumps(loop_details(name)))
    if figures:
        for figure in ("probabilities", "diagnosis"):
            (folder / f"{figure}.svg").write_text(SVG)
    return folder


def study_document(name="made_up"):
    """Return the document of a study with a table of numbers and texts, some of them missing or infinite."""
    frame = DataFrame({"who": [f"{name} {w}" for w in "bcad"], "error": [0.02, np.inf, np.nan, 3e-9],
                       "cost": ["90 (1 %)", "inf (0 %)", "", "1200 (7 %)"]})  # fmt: skip
    columns = Column("who", "identifier"), Column("error", "error [%]", ".3g", 100.0), Column("cost", "cost")
    table = Table("overview", f"Errors of {name}", f"Words of {name}.", frame, columns, grouped=True)
    made = listing("Commands", f"armid study x\nname = '{name}'")
    return Document(name, "Study", f"Is {name} right?", (f"Yes, {name}.", "Complete: 4 of 4 runs."),
                    (Section("Overview", (table,), f"Of {name}."), Section("How it was made", (made,))),
                    facts=(f"Made of {name}.",), main=(table,))  # fmt: skip
