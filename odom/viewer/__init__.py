"""Rerun, fed from Zenoh only."""
