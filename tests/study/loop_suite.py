"""A blind suite of three campaigns, and a study that closes the loop on them with few candidates."""

from input_texts import SUITE_HEAD

SUITE = (
    SUITE_HEAD
    + """\
[[suite.effects]]
name = "supply_sag"
port = "supply"
form = "resistance of both motors"
matching = true
sizes = [{ supply_sag = 0.010 }]
"""
)
STUDY = """\
name = "tiny_blind"
kind = "close_loop"
report = "blind"
question = "Does it name the effect?"
campaigns = "suite"
made_by = "make suite"
key = "suite.key.json"
candidates = ["coulomb", "seal_friction", "supply_sag", "tilt", "viscous"]
"""


def fake_campaigns(folder, *names):
    """Write folders that look like campaigns to who does not read them."""
    for name in names:
        (folder / name).mkdir(parents=True)
        (folder / name / "campaign.toml").write_text(f'name = "{name}"\n', encoding="utf-8")
        (folder / name / "lower.csv").write_text("time_s,angular_velocity_deg_s\n0,0\n", encoding="utf-8")
