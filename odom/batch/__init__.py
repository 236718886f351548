"""Many recordings: each is run once for its content, the settings and the version; one table says how they went."""
