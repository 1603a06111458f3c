"""Place the suite's problems beside the 24 functions of BBOB by exploratory landscape features.

    python3 -m venv out/ela && out/ela/bin/pip install "numpy<2" pflacco
    python studies/suite/landscape.py --out out/landscape

pflacco needs numpy below 2, armid a newer one: this script runs in armid's environment (with the extra `suite`, for
BBOB from ioh), writes the samples, lets the other Python run landscape_features.py, and draws. 250 points a parameter,
Latin hypercube, values scaled to 0 to 1 (features would else tell scales); points that diverge are left out. BBOB:
instance 1 in 4, 8 and 14 dimensions.

landscape.csv: a problem or function a row, its place in the figure, the nearest function of BBOB, and how far that is
in units of the median distance from a function of BBOB to the nearest other one.
"""

import argparse
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import ioh
import numpy as np
import pandas as pd
import seaborn as sns
from scipy.stats import qmc

import armid
from armid.report.style import pyplot

POINTS = 250
DIMENSIONS = (4, 8, 14)
# First function of each of BBOB's groups (Hansen et al. 2009, RR-6829).
GROUPS = {20: "weak structure", 15: "multimodal", 10: "high conditioning", 6: "low conditioning", 1: "separable"}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--pflacco", type=Path, default=Path("out/ela/bin/python"), help="Python that has pflacco")
    parser.add_argument("--out", type=Path, required=True, help="folder for samples, features, table and figure")
    given = parser.parse_args()
    if not given.pflacco.exists():
        parser.error(f"{given.pflacco} does not exist: the Python of an environment with pflacco is expected")
    given.out.mkdir(parents=True, exist_ok=True)
    samples = {f"{name}|{axis}": values for name, X, y in sampled() for axis, values in (("x", X), ("y", y))}
    np.savez(given.out / "samples.npz", **samples)
    features = Path(__file__).with_name("landscape_features.py")
    subprocess.run([str(given.pflacco), str(features), str(given.out)], check=True)
    table, share = placed(pd.read_csv(given.out / "features.csv", index_col=0))
    table.round(4).to_csv(given.out / "landscape.csv", index=False)
    draw(table, share).savefig(given.out / "landscape.png", dpi=130)
    ours = table[table["suite"]]
    print(
        f"{(ours['distance'] > 1.0).sum()} of {len(ours)} problems are farther from every function of BBOB than these "
        f"are from each other (median), the farthest {ours['distance'].max():.2g} times"
    )


def sampled() -> Iterator[tuple[str, Any, Any]]:
    """Give `group/name/n`, points (n_points, n) and values (n_points,), 0 to 1, of each function and problem."""
    functions = [
        (f"{next(g for first, g in GROUPS.items() if number >= first)}/f{number}/{n}", n,
         ioh.get_problem(number, instance=1, dimension=n), 10.0, -5.0)
        for n in DIMENSIONS for number in range(1, 25)
    ]  # fmt: skip
    problems = [(f"suite: {p.difficulty}/{p.name.partition('/')[0]}/{p.n_var}", p.n_var, p, 1.0, 0.0)
                for p in armid.suite()[::15]]  # fmt: skip
    for name, n, function, width, low in (*functions, *problems):
        X = qmc.LatinHypercube(n, rng=np.random.default_rng(1)).random(POINTS * n)
        y = np.asarray(function(low + width * X), float)
        sound = y < 1e99
        y = y[sound] - y[sound].min()
        yield name, X[sound], y / y.max()


def placed(features: pd.DataFrame) -> tuple[pd.DataFrame, Any]:
    """Return a row for each function and problem, and the shares of variance of the main axes of all features."""
    sound = np.isfinite(features).all() & (features.std() > 0.0)
    # ranks: conditions and ratios have tails that would decide alone
    Z = np.asarray(features.loc[:, sound].rank(pct=True) - 0.5)
    axes, widths, _ = np.linalg.svd(Z - Z.mean(axis=0), full_matrices=False)
    table = pd.DataFrame([name.split("/") for name in features.index], columns=["group", "name", "n"])
    table["suite"] = table["group"].str.startswith("suite")
    table["first"], table["second"] = (axes * widths)[:, 0], (axes * widths)[:, 1]
    bbob = np.flatnonzero(~table["suite"])
    apart = np.linalg.norm(Z[:, np.newaxis] - Z[bbob], axis=2)
    # from a function to another function, not to itself in other dimensions
    apart[np.asarray(table["name"])[:, np.newaxis] == np.asarray(table["name"])[bbob]] = np.inf
    nearest = bbob[apart.argmin(axis=1)]
    table["nearest"] = [f"{table['name'][i]} in {table['n'][i]} D" for i in nearest]
    table["distance"] = apart.min(axis=1) / np.median(apart[bbob].min(axis=1))
    return table, widths**2 / np.sum(widths**2)


def draw(table: pd.DataFrame, share: Any) -> Any:
    """Return the figure: BBOB in grey by group, the suite's problems in colour by class of difficulty."""
    figure, axes = pyplot().subplots(figsize=(9.0, 6.0), layout="constrained")
    ours, bbob = table[table["suite"]], table[~table["suite"]]
    sns.scatterplot(bbob, x="first", y="second", style="group", color="0.6", s=40, ax=axes)
    sns.scatterplot(ours, x="first", y="second", hue="group", palette="colorblind", s=70, ax=axes)
    for row in bbob[bbob["n"] == "8"].to_dict("records"):
        place = (row["first"], row["second"])
        axes.annotate(row["name"], place, fontsize=7, color="0.4", xytext=(4, 2), textcoords="offset points")
    axes.set(xlabel=f"first main axis, {share[0]:.0%} of the variance", ylabel=f"second main axis, {share[1]:.0%}")
    axes.legend(title="grey: BBOB,\nnamed in 8 D", loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    return figure


if __name__ == "__main__":
    main()
