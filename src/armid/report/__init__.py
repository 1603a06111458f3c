"""One document a result, and what renders it.

Reading order: `document` (the classes, and what several results say alike), `terminal`, `html` with its
templates, `files` (Markdown, CSV, LaTeX, PNG, SVG, PDF), `style` (colours, legends, and how figures are written),
`result` (what every result shows of itself: repr, table, figure, files; and results read back).
"""
