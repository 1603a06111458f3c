"""The style of every figure."""

from typing import Any

# Okabe-Ito: told apart by colour-blind readers.
OKABE_ITO = {
    "black": "#000000", "orange": "#E69F00", "sky": "#56B4E9", "green": "#009E73", "yellow": "#F0E442",
    "blue": "#0072B2", "vermilion": "#D55E00", "purple": "#CC79A7",
}  # fmt: skip
GREY = "0.6"


def style() -> Any:
    """Return pyplot on a backend without a screen, in the house style."""
    import matplotlib as mpl  # noqa: PLC0415 - takes time to import, and only figures need it
    import seaborn as sns  # noqa: PLC0415

    mpl.use("Agg")
    import matplotlib.pyplot as plt  # noqa: PLC0415

    sns.set_theme(context="notebook", style="ticks", font_scale=1.0)
    return plt
