"""Numbers of a study's report, one method a file."""

from armid.study.metrics.bootstrap import median_interval
from armid.study.metrics.convergence import band
from armid.study.metrics.cramer_rao import EFFICIENT, Efficiency, efficiencies, efficiency
from armid.study.metrics.data_profile import SHARES_LEFT, data_profile, remaining_share
from armid.study.metrics.ecdf import share_hit
from armid.study.metrics.effect_size import a12, size_in_words
from armid.study.metrics.error_map import error_map
from armid.study.metrics.first_hit import ERROR_TARGETS, VALUE_TARGETS, first_hits, held
from armid.study.metrics.fitness_quality import fitness_quality
from armid.study.metrics.histories import Histories, histories
from armid.study.metrics.outcomes import by_parameter, outcomes, truths_of
from armid.study.metrics.percentile import percentile_among
from armid.study.metrics.published import published_values
from armid.study.metrics.ranks import RankTests, p_matrix, rank_tests
from armid.study.metrics.results import Results
from armid.study.metrics.running_time import expected_running_time
from armid.study.metrics.spread import Spread, spread
from armid.study.metrics.success import TOLERANCES, success_rates, wilson
from armid.study.metrics.valley import end_points

__all__ = [
    "EFFICIENT",
    "ERROR_TARGETS",
    "SHARES_LEFT",
    "TOLERANCES",
    "VALUE_TARGETS",
    "Efficiency",
    "Histories",
    "RankTests",
    "Results",
    "Spread",
    "a12",
    "band",
    "by_parameter",
    "data_profile",
    "efficiencies",
    "efficiency",
    "end_points",
    "error_map",
    "expected_running_time",
    "first_hits",
    "fitness_quality",
    "held",
    "histories",
    "median_interval",
    "outcomes",
    "p_matrix",
    "percentile_among",
    "published_values",
    "rank_tests",
    "remaining_share",
    "share_hit",
    "size_in_words",
    "spread",
    "success_rates",
    "truths_of",
    "wilson",
]
