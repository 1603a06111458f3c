"""Identification as a problem of pymoo.

In reading order:
space       which parameters are searched, between which bounds, and what the others are
similarity  the paper's similarity degree S of two series, S1 and S2
fitness     a number per candidate to minimise, and how the records of a campaign join
meter       the budget of a run, cut off exactly, and the one log of its evaluations
problem     records and the model side by side, and all of these as pymoo.core.problem.Problem
cover       noise that a few columns add to white noise
starts      starts of records in motion, fitted with the parameters
simulated   one candidate simulated through every record of a campaign, which `armid simulate` shows
suite       problems to take away: 24, each with 15 instances, for who benchmarks optimisers
"""
