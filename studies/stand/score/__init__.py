"""Judge what a closed loop said of blind campaigns."""
