"""Statistics of a study, a file a topic: metric, table, figure and caption stand together.

- analysis: what an analysis is, and the evidence that it is given: outcomes, and what each run had reached by when
- overview: every identifier on one line, or what closed loops found; what was run
- table1, table2: the paper's tables beside ours
- cramer_rao: scatter of the estimates against the bound
- fitness_quality: which fitness gives right parameters
- success: how often all parameters end within a tolerance; simulations until they are right, until the fitness is best
- convergence: error and fitness against simulations
- errors: by identifier and case; where runs end
- ranks: which identifiers differ
- answer: to the question of a study, a sentence for its kind
"""
