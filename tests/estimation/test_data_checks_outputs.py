"""Mistakes in campaigns of machines with other outputs are named, right campaigns are not accused."""

import re
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from made_machines import write_arm, write_axis, write_link
from test_data_checks import accusations, change, pendulum, rewritten, said_of

from armid.estimation.data_checks import data_issues
from armid.inference.infer import prepared
from armid.model import PLANTS, Model
from armid.problem.space import space_of
from armid.record import read_campaign

FILES = ("a.csv", "b.csv", "c.csv")
ANGLE, SPEED, DRIVE = "angle_deg", "angular_velocity_deg_s", "drive_N_m"
HUB, TWIST, PENDULUM = "hub_angle_deg", "deflection_deg", ("slow.csv", "fast.csv", "other.csv")
both, speed = partial(write_arm, outputs="both"), partial(write_arm, outputs="speed")
bare = partial(write_axis, position=False)


def everywhere(column, function):
    return change(column, function, *FILES)


def together(change_of):
    """Return a mistake in both columns of the link. change_of: hub and deflection -> what is written for them."""

    return rewritten(lambda c: c | dict(zip((HUB, TWIST), change_of(c[HUB], c[TWIST]), strict=True)), *FILES)


# name: campaign, what is done to it, words of which the first sentence about the train records must hold one.
MISTAKES = {
    "angle inverted": (write_arm, (everywhere(ANGLE, np.negative),), r"every.*rad signal: its sign"),
    "angle in rad": (write_arm, (everywhere(ANGLE, np.deg2rad),), "every.*radians under a header in deg"),
    "horizontal": (write_arm, (everywhere(ANGLE, lambda x: x + 90.0),), "every.*from elsewhere: with -90"),
    "of two, speed inverted": (both, (everywhere(SPEED, np.negative),), r"every.*velocity \[rad/s\]: its sign"),
    "of two, angle inverted": (both, (everywhere(ANGLE, np.negative),), r"every.*angle \[rad\]: its sign"),
    "of two, both": (both, (everywhere(ANGLE, np.negative), everywhere(SPEED, np.negative)), "every.*'u': its sign"),
    "upright": (pendulum, (change(ANGLE, lambda x: x + 180.0, *PENDULUM),), "every.*from elsewhere: with 180"),
    "mm": (write_axis, (everywhere("velocity_m_s", lambda v: 1000.0 * v),), r"a\.csv: position_m moves 0\.001 times"),
    "hub inverted": (write_link, (everywhere(HUB, np.negative),), r"every.*hub_angle \[rad\]: its sign"),
    "deflection inverted once": (write_link, (change(TWIST, np.negative, "b.csv"),), r"b\.csv.*deflection.*: its sign"),
    "exchanged": (write_link, (together(lambda hub, twist: (twist, hub)),), "hub_angle and deflection look exchanged"),
    "absolute": (write_link, (together(lambda hub, twist: (hub, hub + twist)),), "deflection looks counted from"),
    "drive late": (write_link, (change(DRIVE, lambda u: np.concatenate([np.full(12, u[0]), u[:-12]]), "a.csv"),),
                   r"a\.csv: its clock looks 0\.(09|1)\d* s early"),
    "deflection in rad": (
        write_link, (everywhere(TWIST, np.deg2rad),), r"every.*deflection \[rad\]: 57\.3 times too small"),
}  # fmt: skip
RIGHT = {
    **{f"arm {c}": partial(write_arm, friction=c) for c in (0.0, 0.05, 0.2)},
    **{f"arm of two {c}": partial(both, friction=c) for c in (0.0, 0.15)},
    "arm by its speed": partial(speed, friction=0.1), "arm, noise": partial(write_arm, noise=20.0),
    # over the top four times, where next to nothing decides
    **{f"arm, long stroke, {step} s": partial(write_arm, size=1.5, friction=0.05, interval=step) for step in
       (0.005, 0.01)},
    **{f"axis {c}": partial(write_axis, friction=c) for c in (0.0, 1.0)},
    "axis, bare": partial(bare, friction=0.7),
    "link": write_link,
    "link, all": partial(write_link, friction=0.3, outputs=("hub_angle_deg", "hub_speed_deg_s", "deflection_deg",
                                                                "deflection_speed_deg_s"), noise=2.0),
}  # fmt: skip
QUICK = {"of two, speed inverted": (), "mm": pytest.mark.slow}


@pytest.mark.parametrize("name", [pytest.param(n, marks=QUICK.get(n, pytest.mark.nightly)) for n in MISTAKES])
def test_a_mistake_is_named(name, tmp_path):
    make, mistakes, words = MISTAKES[name]
    folder = make(tmp_path / "campaign")
    for made in mistakes:
        made(folder)
    said = said_of(folder)
    assert any(re.search(words, sentence) for sentence in said[:1]), said


@pytest.mark.nightly
@pytest.mark.parametrize("name", RIGHT)
def test_a_right_campaign_is_not_accused(name, tmp_path):
    assert accusations(said_of(RIGHT[name](tmp_path / "campaign"))) == []


@pytest.mark.parametrize("begins", [0.1, 0.3])
def test_records_that_all_begin_elsewhere_than_the_model_are_told(tmp_path, begins):
    """The records begin at 0.1 rad, which a plant that starts where it is declared to be may know or not."""
    folder = write_arm(tmp_path / "campaign")
    starts = tuple(replace(c, value=begins) if c.name == "start_angle" else c for c in PLANTS["rotary_arm"].constants)
    plant = replace(PLANTS["rotary_arm"], constants=starts, from_rest=True)
    read = read_campaign(folder, {"rotary_arm": plant})
    said = [s.sentence for s in data_issues(read, Model(read.plant), space_of(Model(read.plant))) if s.kind == "start"]
    if begins == 0.1:
        assert said == []
    else:
        (sentence,) = said
        assert re.match(r"angle: every train record begins -11\.\d to -11\.\d deg away from where rotary_arm", sentence)


@pytest.mark.nightly
def test_a_range_of_the_plant_that_is_too_narrow_accuses_no_record_and_widens(tmp_path):
    """It is a multiple of the machine's scales: a size to expect, and no limit."""
    read = read_campaign(write_link(tmp_path / "campaign"))
    softest = 1.0 * read.plant.scales.speed / read.plant.scales.effort
    narrow = (replace(p, high=softest) if p.name == "stiffness" else p for p in read.plant.parameters)
    plant = replace(read.plant, parameters=tuple(narrow))
    read = replace(read, plant=plant)
    model = Model(plant)
    (issue,) = data_issues(read, model, space_of(model))
    assert (issue.kind, issue.record) == ("bounds", "")
    assert "stiffness may lie outside the range that was searched" in issue.sentence
    _, declared = prepared(model, read, candidates={})
    assert model.parameters["stiffness"].high == pytest.approx(1.0)
    assert declared.values["stiffness"] == pytest.approx(8.0, rel=0.02)
