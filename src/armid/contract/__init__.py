"""What a user's own plant, effect, fitness, identifier or campaign has to keep.

In reading order:
check       the entrance to all contracts; those of a campaign and of a fitness
equations   the contracts of plants and of effects
identifier  the contract of an identifier, and its trial problem
trials      Finding, and the candidates and manoeuvres on which equations are tried
reference   an independent simulation with scipy, which judges the compiled one
"""
