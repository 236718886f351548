"""The paper: recursive robust registration of point pairs, its baselines and noise models. Pure functions."""
