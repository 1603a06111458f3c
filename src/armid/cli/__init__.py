"""The command `armid`; how it begins and is asked to end stands in `armid.__main__`.

Reading order: `main` (the commands by name, errors and exit codes), `options` (what commands share, texts to values,
how they speak), `report` (a result shown and saved, the command that shows it again, import and export), then the other
commands: `campaign` (simulate, identify, identifiability, close-loop), `study` (with tune), `listing`, `check` (with
doctor and bench), `new` (with schema). What they do stands in `armid.api`, which Python users call too.
"""
