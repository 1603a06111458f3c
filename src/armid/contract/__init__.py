"""What a user's own plant, effect, fitness, identifier or campaign has to keep."""
