"""Numbers on the logarithmic axes of pictures."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axis import Axis

ONE_TWO_FIVE = (1.0, 2.0, 5.0)
"""Multiples of the powers of ten that have a number on an axis of few decades."""


def number_plainly(axis: "Axis", multiples: tuple[float, ...] = ONE_TWO_FIVE) -> None:
    """Write plain numbers on a logarithmic axis at these `multiples` of powers of ten alone.

    By itself matplotlib also numbers the ticks between them where the range is narrow, one over another.
    """
    from matplotlib.ticker import LogLocator, NullLocator, StrMethodFormatter

    axis.set_major_locator(LogLocator(subs=multiples))
    axis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axis.set_minor_locator(NullLocator())
