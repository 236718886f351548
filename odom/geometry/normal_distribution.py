"""What robust estimates know of a normal distribution."""

NORMAL_MAD = 1.4826
"""Standard deviation of a normal variable over the median of its absolute value."""
