"""Make a suite of campaigns whose truth only the scorer reads."""
