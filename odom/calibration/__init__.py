"""The camera's calibration from a walk: all poses, landmarks and the camera's parameters adjusted together."""
