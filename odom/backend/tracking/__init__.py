"""The pose of one frame against the map, and how far to trust it."""
