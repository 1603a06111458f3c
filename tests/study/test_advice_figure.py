"""The figure of the advice: one row a pair, both records with their intervals."""

import numpy as np
import pandas as pd

from armid.study.analyses.drawing import save
from armid.study.blind.figures import advice_figure


def test_each_pair_has_its_row_and_both_records(tmp_path):
    found = pd.DataFrame({
        "pair": ["viscous / quadratic_drag", "winding_heating / worm_direction"], "n": [20, 18],
        "advised": [0.9, 1.0], "advised_low": [0.7, 0.84], "advised_high": [0.97, 1.0],
        "random": [0.7, 0.5], "random_low": [0.48, 0.3], "random_high": [0.85, 0.7],
    })  # fmt: skip
    figure = advice_figure(found, 0.8)
    (axis,) = figure.axes
    assert [t.get_text() for t in axis.get_yticklabels()] == [
        "viscous / quadratic_drag (20)", "winding_heating / worm_direction (18)"
    ]  # fmt: skip
    drawn = [container.lines[0].get_xdata() for container in axis.containers]
    assert np.allclose(drawn, [[90.0, 100.0], [70.0, 50.0]])
    assert [t.get_text() for t in figure.legends[0].get_texts()] == ["target 80 %", "advised record", "random record"]
    save(figure, tmp_path / "advice.png", tmp_path / "advice.svg")
    assert (tmp_path / "advice.png").stat().st_size > 5_000
