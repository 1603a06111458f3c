"""The command `armid`.

Reading order: `main` (the commands together, errors and exit codes), `options` (what commands share, texts to values),
`results` (what is written, and the document of it), then a file a command: `simulate`, `identify`, `identifiability`,
`close_loop`, `study`, `report`, `listing`, `check` (with bench), `new`, `transfer` (import and export).
"""
