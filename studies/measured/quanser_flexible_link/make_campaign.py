"""Write the record of the flexible link as a campaign: the catalogue's constants, cut at 12 s, pieces of 4 s.

python studies/measured/quanser_flexible_link/make_campaign.py --data FOLDER --out CAMPAIGN
"""

import sys
from pathlib import Path

import pandas as pd

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from common import main, written
from importers import read_columns

CUT_S, PIECE_S = 12.0, 4.0
COLUMNS = ["time_s", "current_A", "hub_angle_deg", "deflection_deg"]
# The catalogue (config_2dslf.m of the set), SI; none of them is free, each may be off by half of itself.
CATALOGUE = {
    "hub_inertia": 0.06353616, "tip_inertia": 0.170434272, "stiffness": 39.957, "hub_damping": 4.0, "link_damping": 0.0,
}  # fmt: skip
TORQUE_CONSTANT = 8.925


def make(folder: Path, out: Path) -> Path:
    """Write the campaign and return its folder."""
    path = folder / "stage_1.csv"
    whole = pd.DataFrame(read_columns(path, str(path), COLUMNS))
    early = whole["time_s"] < CUT_S - 1e-9
    head = [f"[constants]\ngain = {TORQUE_CONSTANT}  # N m/A, at the gear's output", "[tolerances]\ndefault = 0.5"]
    head += [f"[parameters.{name}]\nfixed = {value}" for name, value in CATALOGUE.items()]
    source = "github.com/basta/quanser-2-dof-serial-flexible-link, commit 48ab0ce6a1b3 (MIT)"
    tables = {"train.csv": whole[early], "held_out.csv": whole[~early]}
    roles = ("train", "holdout")
    records = [(file, role, {"restart_s": PIECE_S}, {}) for file, role in zip(tables, roles, strict=True)]
    return written(out, "quanser_flexible_link", "flexible_link", source, records, tables, "\n" + "\n\n".join(head))


if __name__ == "__main__":
    main(make)
