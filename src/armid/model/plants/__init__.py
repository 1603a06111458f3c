"""The library of plants."""
