"""The sensor's model: lens, rolling shutter, stamp clock and noise, as the stream itself shows them."""
