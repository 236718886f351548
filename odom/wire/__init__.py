"""Messages, keys, Zenoh sessions and MCAP recordings."""
