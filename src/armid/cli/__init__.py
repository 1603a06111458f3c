"""The command `armid`.

Reading order: `start` (how it is asked to end), `main` (the commands by name, errors and exit codes), `options` (what
commands share, texts to values, how they speak), `report` (a result shown and saved, and the command that shows it
again), then the commands: `campaign` (simulate, identify, identifiability, close-loop), `study`, `listing`, `check`
(with doctor and bench), `new` (with schema), `transfer` (import and export). What they do stands in `armid.api`,
which Python users call too.
"""
