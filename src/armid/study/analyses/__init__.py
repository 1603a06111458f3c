"""Statistics of a study, one file a topic: metric, table, figure and caption."""
