"""How far a simulation is from a measurement: measures, and the fitnesses that identifiers minimise."""

from armid.fitness.catalogue import FITNESS, SIMILARITIES
from armid.fitness.fitness import Fitness, as_fitness, join_records, joined, record_weights
from armid.fitness.measures import chi_square, mean_square, nrmse, rmse
from armid.fitness.similarity import numerical_similarity, similarity

__all__ = [
    "FITNESS", "SIMILARITIES", "Fitness", "as_fitness", "chi_square", "join_records", "joined", "mean_square",
    "nrmse", "numerical_similarity", "record_weights", "rmse", "similarity",
]  # fmt: skip
