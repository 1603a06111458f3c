"""The page of the blind suite: tables and figures of a made-up suite, and whether a record more told a pair apart."""

import json

import numpy as np
import pandas as pd
import pytest
from made_up import made_entry, made_report, report

from blind import advice, families, score, tables
from stand.score.judge import Claim

PAIR = ["coulomb", "brush_drop"]


def claim(verdict="explained", **groups):
    return Claim({name: frozenset((name, *others)) for name, others in groups.items()}, verdict)


@pytest.mark.parametrize(("said", "answer"), [
    (claim(coulomb=()), "told apart"),
    (claim("partly_explained", coulomb=()), "told apart"),
    (claim("cannot_tell_apart", coulomb=("brush_drop",)), "still together"),
    (claim("cannot_tell_apart", coulomb=()), "still together"),
    (claim(coulomb=(), brush_drop=()), "still together"),
    (claim(brush_drop=()), "wrong one"),
    (claim("record_disagrees", coulomb=("brush_drop",)), "still together"),
    (claim("record_disagrees", brush_drop=("coulomb",)), "still together"),
    (claim("no_discrepancy"), "neither"),
    (None, "missing"),
])  # fmt: skip
def test_one_answer_for_each_claim(said, answer):
    assert advice.answer("coulomb", said) == answer


def made(advised, random):
    """Return key and reports of campaigns in which the true effect stood alone or not, by choice and place."""
    reports, key = {}, {}
    for choice, found in (("advised", advised), ("random", random)):
        for i, good in enumerate(found):
            name = f"a{i:02d}_{choice}"
            step = ("coulomb", () if good else ("brush_drop",), good)
            reports[name] = report("explained" if good else "cannot_tell_apart", step)
            key[name] = {"class": "pair", "pair": PAIR, "choice": choice, "base": f"a{i:02d}", "power": 0.9, "rank": 1,
                         "tried": 9, "in_doubt": 7, "effects": [{"name": "coulomb"}], "noise": {"kind": "white"},
                         "next": {"shell": True}}  # fmt: skip
    return key, reports


def test_rates_and_the_test_of_pairs_that_were_closed_for_both_choices(tmp_path):
    rows = advice.separations(*made([1, 1, 1, 1, 0], [1, 0, 0, 0, 0]))
    rates = advice.rates(rows)
    (first, whole), aims = rates.to_dict("records"), {t.question: t for t in advice.targets_of(rows, rates)}
    assert (first["pair"], first["n"], first["tried"], first["in_doubt"]) == ("coulomb / brush_drop", 5, 9, 7)
    assert (first["advised"], first["random"], whole["advised"]) == (0.8, 0.2, 0.8)
    assert first["p"] == pytest.approx(0.5**3)
    assert aims["all pairs: told apart by the advised record"].met
    assert aims["all pairs: lead over a random record"].met
    key, reports = made([1, 1, 1], [0, 0, 0])
    del reports["a02_random"]
    targets, sections = score.advice_parts(key, reports, {}, tmp_path)
    assert targets[0].met is False
    rates, campaigns = (part for part in sections["Pairs"] if not isinstance(part, str))
    assert rates.frame["n"].tolist() == [2, 2]
    assert len(campaigns.frame) == 6
    assert (tmp_path / "advice.png").stat().st_size > 5_000


def family(name, truths=(), fault=None, constants=None, dirt="none"):
    return {"class": name, "effects": [{"name": t} for t in truths], "floor": {"holdout": 0.005}, "dirt": dirt,
            "parameters": {"p0": 3e6, "k": 1.0, "eta3": 0.6, "n": 1.2}, "fault": fault or {},
            "constants": constants or {}}  # fmt: skip


def said(*steps, suspects=(), after=0.005, value=1.0, half=0.004, verdict="explained"):
    """Return a report of some steps with suspects as (record, kind), all parameters alike."""
    found = {n: {"value": v * value, "low": v * (value - half), "high": v * (value + half), "trusted": True,
                 "interval_holds": True, "noise_low": v * (value - half / 2.0), "noise_high": v * (value + half / 2.0)}
             for n, v in family("control")["parameters"].items()}  # fmt: skip
    return report(verdict, *steps) | {
        "withdrawn": None, "parameters": {"after": found},
        "suspects": [{"record": record, "kind": kind} for record, kind in suspects],
        "error": {when: {"holdout": {"rmse": rmse}} for when, rmse in (("before", 0.006), ("after", after))},
    }  # fmt: skip


def test_families_are_held_against_their_truth(tmp_path):
    """The figures of each target are those of campaigns that one can count by hand."""
    late = {"kind": "late", "record": "a.csv", "moves": 5.0}
    cases = {
        "f0": (family("fault", fault=late), said(suspects=[("a.csv", "late")])),
        "f1": (family("fault", fault=late), said(("coulomb", (), True), suspects=[("a.csv", "gain")], value=1.02)),
        "f2": (family("fault", fault=late | {"moves": 1.0}), said(("coulomb", (), False))),
        "c0": (family("constant", constants={"R": 0.03}), said(value=1.003, after=0.0056)),
        "t0": (family("two", ("coulomb", "tilt")), said(("viscous", ("coulomb",), False), ("tilt", (), True))),
        "t1": (family("two", ("coulomb", "tilt")), said(("coulomb", (), False), ("tilt", (), True), after=0.007)),
        "n0": (family("control", dirt="gap"), said(suspects=[("a.csv", "gap")], verdict="no_discrepancy")),
        "n1": (family("control", dirt="hum"), said(suspects=[("a.csv", "gap")], verdict="unexplained")),
    }
    key, reports = ({name: case[i] for name, case in cases.items()} for i in (0, 1))
    targets, sections = families.parts(key, reports, {"f0": (9.0, 4.0), "f1": (9.0, 70.0)}, tmp_path)
    found = {t.question: (t.found, t.among, t.met) for t in targets}
    expected = {
        "one faulty record, moved by more than 2 times its noise: record and kind are right": (0.5, 2, False),
        "one faulty record: a physical name is claimed": (1 / 3, 3, False),
        "one faulty record: parameters inside their interval": (2 / 3, 12, False),
        "one faulty record: parameters inside the interval of noise alone": (2 / 3, 12, False),
        "constants off: a wrong physical name alone": (0.0, 1, True),
        "constants off: parameters inside their interval": (1.0, 4, True),
        "all but constants off: parameters inside the interval of noise alone": (24 / 28, 28, None),
        "all: parameters inside their interval": (28 / 32, 32, None),
        "one constant off: held-out error up to 1.1 of the noise": (0.0, 1, False),
        "two effects: all named, alone or in a group": (0.5, 2, False),
        "two effects: a wrong name is claimed": (0.0, 2, True),
        "three effects: all named, alone or in a group": (None, 0, None),
        "controls: unexplained": (0.5, 2, False),
        "controls: a record is accused": (0.5, 2, False),
        "all: held-out error of the model in force worse than of the declared": (1 / 8, 8, False),
        "all: trusted parameters off by more than 1 %": (4 / 32, 32, None),
        "CPU time of a campaign, worst [s]": (70.0, 2, False),
    }
    assert {question: found[question] for question in expected} == expected
    misses = next(part for part in sections["Campaigns"] if part.name == "misses").frame
    assert set(misses["campaign"]) == {"f1", "c0", "t1", "n1"}
    assert len(pd.read_csv(tmp_path / "campaigns.csv")) == 8


def test_the_page_shows_every_table_and_figure_and_the_tables_agree_with_the_judgements(tmp_path_factory):
    folder, rng = tmp_path_factory.mktemp("scored"), np.random.default_rng(5)
    key = {f"c{i:03d}": made_entry(rng) for i in range(120)}
    for name, entry in [*key.items()][:-1]:
        (folder / "reports" / name).mkdir(parents=True)
        (folder / "reports" / name / "report.json").write_text(json.dumps(made_report(rng, entry)))
    (folder / "key.json").write_text(json.dumps({"campaigns": key}))
    assert score.main([str(folder / "reports"), "--key", str(folder / "key.json"), "--out", str(folder / "out")]) == 0
    suite = folder / "out"
    page = (suite / "report.md").read_text()
    assert "NOT COMPLETE: 119 of 120 campaigns" in page
    assert "| campaigns without a report | 1 | = 0 | 120 | missed |" in page
    assert "(held_out.png)" in page
    assert (suite / "held_out.png").stat().st_size > 5_000
    names = ("targets", "answers", "effects", "confusion", "false_alarms", "two", "unlisted", "one_stroke", "held_out")
    for table in (*names, "bias"):
        assert len(pd.read_csv(suite / f"{table}.csv")) > 0
    rows = pd.read_csv(suite / "campaigns.csv")
    single = rows[(rows["class"] == "single") & (rows["judgement"] != "missing")]
    assert set(single["answer"]) <= {*tables.ANSWERS}
    effects = pd.read_csv(suite / "effects.csv")
    assert effects["n"].sum() == len(single)
    held = single[single["matters"].astype(str) == "True"]
    assert effects["right"].sum() == held["judgement"].isin(["right", "group"]).sum()
    confusion = pd.read_csv(suite / "confusion.csv")
    given = confusion[list(tables.ANSWERS)].sum()
    assert given[given > 0].to_dict() == single["answer"].value_counts().to_dict()
    moves = confusion["moves"] == "more than 20 %"
    assert moves.is_monotonic_decreasing
    assert confusion[moves][list(tables.ANSWERS)].sum().sum() == len(held)
    answers = pd.read_csv(suite / "answers.csv").set_index("class")
    assert (
        answers.loc["control", "false_alarm"] == (rows[rows["class"] == "control"]["judgement"] == "false_alarm").sum()
    )
    listed = rows[rows["class"].isin(["single", "two"]) & rows["matching"].astype(bool)].dropna(subset=["after"])
    bias = pd.read_csv(suite / "bias.csv").set_index(["form", "parameter"])
    expected = np.median(np.abs(listed[[f"bias_after_{p}" for p in ("p0", "k", "eta3", "n")]].to_numpy()))
    assert bias.loc[("matching", "all"), "after"] == pytest.approx(expected)
