"""Frames in order to poses: what is published, its covariance, and the final trajectory."""
