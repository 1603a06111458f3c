"""Rank tests against the example of Demsar 2006 and closed forms, and effect sizes."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import mannwhitneyu

from armid.study.analyses.ranks import (
    a12,
    critical_difference_figure,
    mean_ranks,
    p_matrix,
    pairs,
    rank_tests,
    signed_rank,
    size_in_words,
)

# Table 6 of Demsar, J. Mach. Learn. Res. 7 (2006) 1: AUC of four classifiers on 14 data sets. On the last but one the
# two to the right are printed alike, 0.975, but ranked 2 and 3: 0.97501 stands for the digits that are not printed.
AUC = np.array([
    [0.763, 0.768, 0.771, 0.798], [0.599, 0.591, 0.590, 0.569], [0.954, 0.971, 0.968, 0.967],
    [0.628, 0.661, 0.654, 0.657], [0.882, 0.888, 0.886, 0.898], [0.936, 0.931, 0.916, 0.931],
    [0.661, 0.668, 0.609, 0.685], [0.583, 0.583, 0.563, 0.625], [0.775, 0.838, 0.866, 0.875],
    [1.000, 1.000, 1.000, 1.000], [0.940, 0.962, 0.965, 0.962], [0.619, 0.666, 0.614, 0.669],
    [0.972, 0.981, 0.97501, 0.975], [0.957, 0.978, 0.946, 0.970],
])  # fmt: skip
NAMES = ["C4.5", "C4.5+m", "C4.5+cf", "C4.5+m+cf"]


def outcomes_of(blocks, names, seeds=1):
    """One row a case, column a variant; every seed the same."""
    rows = [
        {"case": f"case {i}", "variant": name, "seed": s, "largest_error": blocks[i, j]}
        for i in range(len(blocks)) for j, name in enumerate(names) for s in range(seeds)
    ]  # fmt: skip
    return pd.DataFrame(rows)


def test_demsars_mean_ranks_with_their_matrix_tables_and_diagram():
    tests = rank_tests(outcomes_of(1.0 - AUC, NAMES))
    assert tests.ranks[NAMES].round(3).tolist() == [3.143, 2.000, 2.893, 1.964]
    assert list(tests.ranks.index[:2]) == ["C4.5+m+cf", "C4.5+m"]
    matrix = p_matrix(tests)
    assert (matrix.to_numpy() == matrix.to_numpy().T).all()
    assert (np.diag(matrix) == 1.0).all()
    first = tests.pairs.iloc[2]
    assert matrix.loc[first["first"], first["second"]] == first["p_holm"] >= first["p"]
    assert "p = " in mean_ranks(tests, pd.Series(dtype=float), "noise-free", "ranks").caption
    table = pairs(tests, "noise-free", "pairs")
    assert len(table.frame) == 6
    assert (table.frame.iloc[:3][["first", "second"]] == "C4.5+m+cf").any(axis=1).all()
    figure = critical_difference_figure(tests, {name: i for i, name in enumerate(NAMES)})
    assert figure.axes[0].get_title() == ""
    assert {t.get_text().split(" (")[0] for t in figure.axes[0].texts if " (" in t.get_text()} >= {"C4.5+m"}
    plt.close(figure)


def test_what_seeds_tiny_errors_and_cases_that_not_all_ran_count():
    one, many = (rank_tests(outcomes_of(1.0 - AUC, NAMES, seeds)) for seeds in (1, 7))
    assert one.friedman == many.friedman
    assert one.pairs["p"].tolist() == many.pairs["p"].tolist()
    tests = rank_tests(outcomes_of(np.array([[1e-9, 1e-13, 1.0], [1e-12, 1e-10, 1.0]]), ["a", "b", "c"]))
    assert tests.ranks.to_dict() == {"a": 1.5, "b": 1.5, "c": 3.0}
    assert tests.pairs.loc[0, "a12"] == 0.5
    frame = outcomes_of(1.0 - AUC, NAMES)
    assert rank_tests(frame[~((frame["case"] == "case 3") & (frame["variant"] == "C4.5"))]).n_cases == 13
    assert np.isnan(rank_tests(outcomes_of(AUC[:, :2], NAMES[:2])).p)


def test_signed_rank_of_pairs_that_all_agree_is_two_of_all_signs_and_1_without_a_difference():
    for n in (5, 8):
        assert signed_rank(np.arange(1.0, n + 1), 3.0 * np.arange(1.0, n + 1) ** 2) == pytest.approx(2.0 ** (1 - n))
    assert signed_rank(np.ones(6), np.ones(6)) == 1.0
    assert signed_rank(np.ones(1), 2.0 * np.ones(1)) == 1.0
    assert signed_rank(np.full(6, np.inf), np.full(6, np.inf)) == 1.0


SAMPLES = st.lists(st.integers(0, 9).map(float), min_size=1, max_size=15)


@given(SAMPLES, SAMPLES)
def test_the_effect_size_is_the_mann_whitney_statistic_over_the_pairs(x, y):
    assert a12(x, y) == pytest.approx(mannwhitneyu(y, x).statistic / (len(x) * len(y)))
    assert a12(x, y) + a12(y, x) == pytest.approx(1.0)


def test_effect_sizes_by_hand_with_a_tie_and_a_failure():
    assert a12([1.0, 2.0], [2.0, np.inf]) == (2 + 1.5) / 4
    words = [size_in_words(value) for value in (0.5, 0.44, 0.57, 0.65, 0.28, 1.0)]
    assert words == ["negligible", "small", "small", "medium", "large", "large"]
