"""Critical-difference diagram: mean ranks, and bars over those that cannot be told apart."""

import warnings
from typing import Any

from armid.study.figures.style import INK, look, pyplot
from armid.study.metrics import RankTests, p_matrix

LEAST_CASES = 20


def critical_difference_figure(tests: RankTests, setting: str) -> Any:
    """Draw the mean ranks on a line; a bar joins identifiers whose pairs are not significant at 5 %.

    The pairs are those of Wilcoxon with Holm. Source: Demsar, J. Mach. Learn. Res. 7 (2006) 1.
    """
    import scikit_posthocs as sp  # noqa: PLC0415 - takes time to import

    plt = pyplot()
    n = len(tests.ranks)
    figure, axis = plt.subplots(figsize=(10.5, 1.6 + 0.26 * n), layout="constrained")
    colours = {name: look(i)["color"] for i, name in enumerate(tests.blocks.columns)}
    with warnings.catch_warnings():
        # pandas warns scikit-posthocs of what it does inside
        warnings.simplefilter("ignore", FutureWarning)
        sp.critical_difference_diagram(
            tests.ranks, p_matrix(tests), ax=axis, color_palette=colours, label_fmt_left="{label} ({rank:.2f})",
            label_fmt_right="({rank:.2f}) {label}", label_props={"fontsize": 10}, crossbar_props={"color": INK},
        )  # fmt: skip
    axis.set_title(f"mean rank over {tests.n_cases} cases, {setting}: 1 is best", fontsize="medium")
    return figure
