"""Runs many recordings, each once per content, settings and version, and sums up the results in a table."""
