"""Rigid motions, shared array types, and how numerical loops are compiled: what everything else stands on."""
