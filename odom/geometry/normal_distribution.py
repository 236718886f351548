"""Constants of the normal distribution that robust estimates use."""

NORMAL_MAD = 1.4826
"""Standard deviation of a normal variable over the median of its absolute value."""
