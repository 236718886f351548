"""Trajectory, key frames and map of a recording in the formats of other tools; one module a format."""
