"""The blind suite: what closed loops said, held against the truth."""
