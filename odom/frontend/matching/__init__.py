"""Correspondences: features followed from frame to frame, landmarks found in a frame, and places matched by looks."""
