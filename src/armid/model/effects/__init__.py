"""The library of effects, one file a family: friction, bodies, drive (motor and balance too), control, sensor."""
