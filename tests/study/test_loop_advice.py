"""Whether a record more told a pair apart: answers, rates, the sign test, and what is asked of the advice."""

import pandas as pd
import pytest
from loop_suite import STUDY, fake_campaigns

from armid.errors import ArmidError
from armid.study.blind.report import advice_parts
from armid.study.blind.scores import Claim, advice_targets, rates, separations, sign_test
from armid.study.blind.scores import advice_answer as answer_of
from armid.study.tasks import read_study

PAIR = ["coulomb", "brush_drop"]


def claim(verdict="explained", empirical=(), **groups):
    return Claim({name: frozenset((name, *others)) for name, others in groups.items()}, empirical, verdict)


@pytest.mark.parametrize(
    ("said", "answer"),
    [
        (claim(coulomb=()), "told apart"),
        (claim("partly_explained", coulomb=()), "told apart"),
        (claim("cannot_tell_apart", coulomb=("brush_drop",)), "still together"),
        (claim("cannot_tell_apart", coulomb=()), "still together"),
        (claim(coulomb=(), brush_drop=()), "still together"),
        (claim(brush_drop=()), "wrong one"),
        (claim("partly_explained", ("unnamed:torque",), coulomb=()), "still together"),
        (claim("no_discrepancy"), "neither"),
        (None, "missing"),
    ],
)
def test_one_answer_for_each_claim(said, answer):
    assert answer_of("coulomb", said) == answer


def made(advised, random):
    """Return loops and key of campaigns in which the true effect stood alone or not, by choice and place."""
    loops, key = [], {}
    for choice, found in (("advised", advised), ("random", random)):
        for i, good in enumerate(found):
            name = f"a{i:02d}_{choice}"
            alternatives = [] if good else ["brush_drop"]
            steps = [{"effect": "coulomb", "alternatives": alternatives, "empirical": False}]
            verdict = "explained" if good else "cannot_tell_apart"
            loops.append({"case": name, "report": {"verdict": verdict, "effects": ["coulomb"], "steps": steps}})
            key[name] = {"class": "pair", "pair": PAIR, "choice": choice, "base": f"a{i:02d}", "power": 0.9, "rank": 1,
                         "tried": 9, "in_doubt": 7, "effects": [{"name": "coulomb"}], "noise": {"kind": "white"},
                         "next": {"shell": True}}  # fmt: skip
    return pd.DataFrame(loops), key


def test_rates_and_the_test_of_pairs():
    rows = separations(*made([1, 1, 1, 1, 0], [1, 0, 0, 0, 0]), list(made([1] * 5, [1] * 5)[1]))
    first, whole = rates(rows).to_dict("records")
    assert (first["pair"], first["n"], first["tried"], first["in_doubt"]) == ("coulomb / brush_drop", 5, 9, 7)
    assert (first["advised"], first["random"], whole["advised"]) == (0.8, 0.2, 0.8)
    assert first["p"] == pytest.approx(0.5**3)
    met = {(t.topic, t.question): t.met for t in advice_targets(rows)}
    assert met[("all pairs", "told apart by the advised record")] is True
    assert met[("all pairs", "lead over a random record")] is True


def test_no_lead_is_no_lead():
    loops, key = made([1, 0], [0, 1])
    (lead,) = [t for t in advice_targets(separations(loops, key, list(key))) if "lead" in t.question and
               t.topic == "all pairs"]  # fmt: skip
    assert (lead.found, lead.met) == (0.0, False)
    assert sign_test(0, 0) == 1.0


def test_a_campaign_that_was_closed_for_one_choice_alone_does_not_count():
    loops, key = made([1, 1, 1], [0, 0, 0])
    rows = separations(loops.iloc[:-1], key, list(key))
    assert rates(rows)["n"].tolist() == [2, 2]
    assert advice_targets(rows)[0].met is False
    _, main, sections = advice_parts(rows)
    assert len(main.frame) == 5
    assert [len(s.figures) for s in sections] == [0, 1]


def test_a_key_of_other_campaigns_is_refused():
    loops, key = made([1], [1])
    del key["a00_random"]["choice"]
    with pytest.raises(ArmidError, match="does not tell of campaign 'a00_random' who chose"):
        separations(loops, key, list(key))


def test_rivals_are_looked_for_in_their_campaigns_alone(tmp_path):
    fake_campaigns(tmp_path / "suite", "a01", "b01")
    (tmp_path / "blind.toml").write_text(STUDY + '[rivals]\n"a*" = ["tilt"]\n', encoding="utf-8")
    study = read_study(tmp_path / "blind.toml")
    assert study.candidates_for("a01") == ("tilt",)
    assert study.candidates_for("b01") == study.candidates
    assert ['"candidates":["tilt"]' in p.settings for p in study.plan()] == [True, False]
