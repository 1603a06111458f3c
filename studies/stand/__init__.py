"""Simulate and measure the shell transfer arm, independently of the package that identifies it."""
