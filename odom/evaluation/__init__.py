"""How good a trajectory is: alignment, metrics, the paper's benchmark."""
