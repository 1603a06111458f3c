"""What a user's own plant, effect, fitness, identifier or campaign has to keep.

In reading order:
check       the entrance to all contracts; those of a campaign, of a fitness and of an identifier
equations   the contracts of plants and of effects
trials      ContractPoint, candidates and manoeuvres on which equations are tried, and the independent simulation with
            scipy that judges the compiled one
"""
