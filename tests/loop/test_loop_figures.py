"""Figures of a closed loop, by hand: bars of the diagnosis, parameters in % of their value."""

from types import SimpleNamespace

import numpy as np
import pytest

from armid.inference.checks import Diagnosis, Finding
from armid.loop.figures import diagnosis_figure, parameter_figure
from armid.report.style import pyplot


def test_the_parts_of_a_diagnosis_are_bars_from_noise_the_largest_first() -> None:
    before = Diagnosis((Finding("record", "a.csv", 4.0, 0.1), Finding("record", "b.csv", 9.0, 0.0),
                        Finding("dependence", "omega", 0.5, 0.9)), noise_known=True)  # fmt: skip
    after = Diagnosis((Finding("record", "b.csv", 1.5, 0.4),), noise_known=True)
    found = SimpleNamespace(campaign=SimpleNamespace(name="c"), before=SimpleNamespace(diagnosis=before),
                            after=SimpleNamespace(diagnosis=after))  # fmt: skip
    figure = diagnosis_figure(found)
    records, variables = figure.axes
    assert [t.get_text() for t in records.get_yticklabels()] == ["b.csv", "a.csv"]
    ends = [[bar.get_x() + bar.get_width() for bar in bars] for bars in records.containers]
    # what was not found after is as noise
    assert ends == [[9.0, 4.0], [1.5, 1.0]]
    assert variables.containers[0][0].get_width() == pytest.approx(-0.5)
    pyplot().close(figure)


def test_parameters_are_drawn_in_percent_of_their_value_with_the_truth_where_it_is_known() -> None:
    def entry(value: float, low: float, high: float, trusted: bool = True) -> dict[str, object]:
        return {"value": value, "low": low, "high": high, "unit": "Pa", "trusted": trusted}

    after = {"p0": entry(2e6, 1.9e6, 2.2e6), "sag": entry(-4.0, -5.0, -3.0), "off": entry(0.0, -1.0, 1.0)}
    before = {"p0": entry(2.5e6, 2.4e6, 2.6e6, trusted=False)}
    figure = parameter_figure("c", {"before": before, "after": after}, {"p0": 2.1e6})
    p0, sag = figure.axes
    assert (p0.get_title(), sag.get_title()) == ("p0, 2 MPa", "sag, -4e-06 MPa")
    marks = [container.lines[0].get_ydata()[0] for container in p0.containers]
    assert marks == pytest.approx([25.0, 0.0])
    (bar,) = p0.containers[1].lines[2]
    assert np.ravel(bar.get_segments()[0][:, 1]) == pytest.approx([-5.0, 10.0])
    (truth,) = [line for line in p0.lines if line.get_linestyle() == "--"]
    assert truth.get_ydata()[0] == pytest.approx(5.0)
    assert len(sag.containers) == 1
    (bar,) = sag.containers[0].lines[2]
    assert np.ravel(bar.get_segments()[0][:, 1]) == pytest.approx([-25.0, 25.0])
    assert "dashed: true" in figure.get_suptitle()
    pyplot().close(figure)
