"""Write the quarter drone's records as a campaign, by the published protocol.

    python studies/measured/quarter_drone/make_campaign.py --data FOLDER --out CAMPAIGN

20 s to 80 s of each record, every fifth sample (20 Hz). The first 80 % of multisine and steps train, their last 20 %
and the whole of the swept sine are held out; each part runs freely from its measured start: the angle, and the slope
of a Savitzky-Golay filter of 11 points and order 3.
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.signal import savgol_filter

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from common import main, written
from importers import read_columns

FILES = {
    "multisine": "sinal4_multiseno_malha_fechada.csv",
    "steps": "sinal2_degraus_malha_fechada.csv",
    "swept": "sinal3_swept_sine_malha_fechada.csv",
}
COLUMNS = {"Tempo_s": "time_s", "Saida_y": "angle_deg", "Controle_u": "command_percent"}
RATE_HZ, FROM_S, TO_S, EVERY, TRAIN = 100.0, 20.0, 80.0, 5, 0.8


def make(folder: Path, out: Path) -> Path:
    """Write the campaign and return its folder."""
    records, tables = [], {}
    for name, file in FILES.items():
        whole = pd.DataFrame(read_columns(folder / file, str(folder / file), list(COLUMNS))).rename(columns=COLUMNS)
        kept = whole[(whole["time_s"] >= FROM_S - 1e-9) & (whole["time_s"] < TO_S - 1e-9)].iloc[::EVERY]
        cut = int(TRAIN * len(kept)) if name != "swept" else 0
        for word, role, part in (("train", "train", kept[:cut]), ("test", "holdout", kept[cut:])):
            if len(part):
                angle = np.radians(part["angle_deg"].to_numpy())
                slope = savgol_filter(angle, 11, 3, deriv=1, delta=EVERY / RATE_HZ)
                start = {"start_angle": float(angle[0]), "start_speed": float(slope[0])}
                records.append((f"{name}_{word}.csv", role, {}, start))
                tables[f"{name}_{word}.csv"] = part
    source = "github.com/helonayala/sysid, commit 3802c648c330 (Unlicense)"
    return written(out, "quarter_drone", "quarter_drone", source, records, tables)


if __name__ == "__main__":
    main(make)
