"""Kinds of hypotheses."""
