"""Studies: a question, its runs, their store, its report."""
