"""The library of effects, one file a family: friction, bodies, drive, motor, balance, control, sensor."""
