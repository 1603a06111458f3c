"""Identify the unknown parameters of a driven arm from its measured motion."""
