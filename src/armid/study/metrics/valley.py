"""Where runs end: deviations from the truth, one row a run."""

from pandas import DataFrame

# The parameters that stand in for each other on the arm; others where a study has others.
VALLEY = ("p0", "eta3", "n")
MOST = 3


def end_points(estimates: DataFrame) -> DataFrame:
    """Return variant, setting and the deviation (value - truth)/abs(truth) [%] of each parameter, one row a run.

    estimates: one row a run and parameter; runs with an unknown truth are left out. The columns are the p0-eta3-n
    valley where these are free, else the first three parameters.
    """
    known = estimates[estimates["truth"].notna()]
    deviation = 100.0 * (known["value"] - known["truth"]) / known["truth"].abs()
    wide = known.assign(deviation=deviation).pivot(index="run", columns="parameter", values="deviation")
    names = list(dict.fromkeys(known["parameter"]))
    chosen = list(VALLEY) if set(VALLEY) <= set(names) else names[:MOST]
    groups = known.drop_duplicates("run").set_index("run")[["variant", "setting"]]
    return groups.join(wide[chosen].dropna(), how="inner")
