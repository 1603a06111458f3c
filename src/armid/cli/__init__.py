"""The command `armid`.

Reading order: `main` (the commands together, errors and exit codes), `options` (what commands share, texts to values),
`report` (what is written, the document of it, and the command that shows it again), then a file a command: `simulate`,
`identify`, `identifiability`, `close_loop`, `study`, `listing`, `check` (with bench), `new`, `transfer` (import and
export).
"""
