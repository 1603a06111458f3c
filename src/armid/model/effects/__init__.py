"""The library of effects, one file a family."""
