"""Studies: a question, its runs, their store; read from `armid.study.study`, `runner` and `results`."""
