"""Features of one frame: corners, patches, depth planes, measurements, and descriptors of places."""
