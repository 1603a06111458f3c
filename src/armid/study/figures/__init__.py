"""Figures of a study's report, one a file."""

from armid.study.figures.convergence import convergence_figure
from armid.study.figures.cramer_rao import cramer_rao_figure
from armid.study.figures.data_profile import data_profile_figure
from armid.study.figures.ecdf import ecdf_figure
from armid.study.figures.error_map import error_map_figure
from armid.study.figures.figure import Figure
from armid.study.figures.fitness_quality import fitness_quality_figure
from armid.study.figures.ranks import LEAST_CASES, critical_difference_figure
from armid.study.figures.running_time import running_time_figure
from armid.study.figures.style import save
from armid.study.figures.success import success_figure
from armid.study.figures.table1 import table1_figure
from armid.study.figures.table2 import table2_figure
from armid.study.figures.valley import valley_figure

__all__ = [
    "LEAST_CASES",
    "Figure",
    "convergence_figure",
    "cramer_rao_figure",
    "critical_difference_figure",
    "data_profile_figure",
    "ecdf_figure",
    "error_map_figure",
    "fitness_quality_figure",
    "running_time_figure",
    "save",
    "success_figure",
    "table1_figure",
    "table2_figure",
    "valley_figure",
]
