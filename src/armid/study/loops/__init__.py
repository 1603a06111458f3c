"""Studies that close the loop on many campaigns, and how what was said is held against the truth."""
