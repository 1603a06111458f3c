"""Statistics of a study, a file a topic: metric, table, figure and caption stand together.

- analysis: what an analysis is, and the evidence that it is given: outcomes, and what each run had reached by when
- overview: the answer in a sentence; every identifier on one line, or what closed loops found; what was run
- paper_tables: the paper's tables beside ours
- cramer_rao: scatter of the estimates against the bound
- convergence: how often all parameters end within a tolerance; error, fitness and targets hit against simulations
- errors: by identifier and case; where runs end; which fitness gives right parameters
- ranks: which identifiers differ
"""
