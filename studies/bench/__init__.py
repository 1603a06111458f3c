"""How fast, how right and how large: the engine and the framework of armid against their baselines.

    armid bench [--quick]                 from the root of the project

- run: every measurement in one run; samples: what is measured
- engine: against scipy and a plain compiled loop (baselines), with effects, on two threads, and the fitness
- framework: where the time of one identification goes; processes: memory, large campaigns, the second start
- measure: a line of the table, the clock, the table
"""
