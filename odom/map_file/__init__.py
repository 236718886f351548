"""Maps on disk: one SQLite file, written in transactions while the camera moves, checked by checksums when read."""
