"""Write FOLDER/features.csv from FOLDER/samples.npz, in an environment with pflacco: see landscape.py."""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
from pflacco import classical_ela_features as ela

SETS = (ela.calculate_ela_distribution, ela.calculate_ela_meta, ela.calculate_nbc, ela.calculate_dispersion)

folder = Path(sys.argv[1])
rows, samples = {}, np.load(folder / "samples.npz")
for name in dict.fromkeys(key.rpartition("|")[0] for key in samples.files):
    X, y = pd.DataFrame(samples[f"{name}|x"]), pd.Series(samples[f"{name}|y"])
    found = {k: v for features in SETS for k, v in features(X, y).items()}
    found |= ela.calculate_information_content(X, y, seed=1)
    rows[name] = {k: v for k, v in found.items() if "costs" not in k}
    print(name, flush=True)
pd.DataFrame.from_dict(rows, orient="index").to_csv(folder / "features.csv")
