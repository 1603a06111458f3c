"""What a hypothesis is, and its kinds, one file each: effects, faults, drifts, unknown.

Also here: same_law (effects that are what the declared model has already), missing_signal (the signal that a model
lacks at each port).
"""
