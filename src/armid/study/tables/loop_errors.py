"""Errors held out, parameters and times of closed loops."""

import numpy as np
from pandas import DataFrame

from armid.study.loops.targets import PARAMETERS, bias, matching_rows, of_class
from armid.study.tables.loop_answers import COUNT, PERCENT, frame_of, parts
from armid.study.tables.table import Column, Table

FORMS = {"matching": True, "other": False}


def held_out(rows: DataFrame) -> Table:
    """Return the error held out before and after, over the noise, by class."""
    lines = []
    for label, part in parts(rows).items():
        known = part.dropna(subset=["after_over_floor"])
        if known.empty:
            continue
        before, after = known["before_over_floor"], known["after_over_floor"]
        lines.append({
            "class": label, "n": len(known), "before": before.median(), "before_most": before.max(),
            "after": after.median(), "after_90": after.quantile(0.9), "after_most": after.max(),
            "within": float((after <= 1.10).mean()), "cut": known["cut"].median(),
            "excess_cut": known["excess_cut"].median(),
        })  # fmt: skip
    columns = (
        Column("class", "campaigns"), Column("n", "n", COUNT), Column("before", "before, median", ".3g"),
        Column("before_most", "largest", ".3g"), Column("after", "after, median", ".4g"),
        Column("after_90", "90 %", ".4g"), Column("after_most", "largest", ".4g"),
        Column("within", "up to 1.10 [%]", *PERCENT), Column("cut", "cut, median [%]", *PERCENT),
        Column("excess_cut", "cut above noise [%]", *PERCENT),
    )  # fmt: skip
    words = (
        "RMSE on the records held out over the noise that is really in them (rms of what was written less what the "
        "simulated arm did), before and after the loop. Cut: 1 - after/before; above noise: of sqrt(RMSE^2 - noise^2)."
    )
    return Table("held_out", "Error on records held out", words, frame_of(lines, columns), columns)


def parameter_bias(rows: DataFrame) -> Table:
    """Return how far the parameters are from the truth before and after, by form and parameter."""
    lines = []
    for form, matching in FORMS.items():
        part = matching_rows(rows, matching)
        for name in ("all", *PARAMETERS) if len(part) else ():
            names = PARAMETERS if name == "all" else (name,)
            before, after = (bias(part, when, names) for when in ("before", "after"))
            lines.append({
                "form": form, "parameter": name, "n": len(after),
                "before": before.median(), "before_most": before.max(),
                "after": after.median(), "after_90": after.quantile(0.9), "after_most": after.max(),
            })  # fmt: skip
    columns = (
        Column("form", "form"), Column("parameter", "parameter"), Column("n", "n", COUNT),
        Column("before", "before, median [%]", ".3g", 100.0), Column("before_most", "largest [%]", ".3g", 100.0),
        Column("after", "after, median [%]", ".3g", 100.0), Column("after_90", "90 % [%]", ".3g", 100.0),
        Column("after_most", "largest [%]", ".3g", 100.0),
    )  # fmt: skip
    words = "Size of the relative error; campaigns of one or two listed effects, by whether the form is the library's."
    return Table("bias", "Bias of the parameters", words, frame_of(lines, columns), columns)


def trust(rows: DataFrame) -> Table:
    """Return how often a parameter is trusted, and how far off it is then."""
    lines = []
    for label, part in parts(rows).items():
        for name in PARAMETERS if len(part) else ():
            trusted = part[f"trusted_{name}"].astype(bool)
            off = part[f"bias_after_{name}"].astype(float).abs()
            lines.append({
                "class": label, "parameter": name, "n": len(part), "trusted": float(trusted.mean()),
                "off": off[trusted].median() if trusted.any() else np.nan,
                "off_most": off[trusted].max() if trusted.any() else np.nan,
                "off_other": off[~trusted].median() if (~trusted).any() else np.nan,
            })  # fmt: skip
    columns = (
        Column("class", "campaigns"), Column("parameter", "parameter"), Column("n", "n", COUNT),
        Column("trusted", "trusted [%]", *PERCENT), Column("off", "trusted: error, median [%]", ".2g", 100.0),
        Column("off_most", "largest [%]", ".2g", 100.0), Column("off_other", "not trusted: median [%]", ".2g", 100.0),
    )  # fmt: skip
    words = "How often the value after the loop is called trusted, and its relative error where it is and where not."
    return Table("trust", "Which parameters are trusted", words, frame_of(lines, columns), columns)


def times(rows: DataFrame) -> Table:
    """Return how long it takes to close a campaign, by class."""
    lines = []
    for label, part in ({"all": rows} | {c: of_class(rows, c) for c in dict.fromkeys(rows["class"])}).items():
        lines.append({"class": label, "n": len(part)} | {
            f"{key}_{word}": value for key in ("seconds", "cpu_seconds") for word, value in {
                "median": part[key].median(), "90": part[key].quantile(0.9), "most": part[key].max()}.items()
        })  # fmt: skip
    columns = (
        Column("class", "campaigns"), Column("n", "n", COUNT),
        *(Column(f"{key}_{w}", f"{t} {w} [s]", ".3g") for key, t in (("seconds", "wall"), ("cpu_seconds", "CPU"))
          for w in ("median", "90", "most")),
    )  # fmt: skip
    words = (
        "Time to close one campaign on one thread, what was compiled meanwhile included; 90: nine of ten take no "
        "longer. Times hang on the machine and on what else it did."
    )
    return Table("times", "Times", words, frame_of(lines, columns), columns)
