"""One line of a diagnosis: what was measured, whether it is good enough, and what to do."""

from dataclasses import dataclass
from enum import Enum, unique

WITHIN_95 = 1.96
"""Sigmas of a normal distribution between which 95 % lie: so findings give how sure they are."""


@unique
class Verdict(Enum):
    """`BAD` would spoil the odometry; `UNKNOWN` could not be judged from this recording."""

    GOOD = "good"
    UNKNOWN = "not judged"
    BAD = "BAD"


@dataclass(frozen=True)
class Finding:
    """`key` names the check, `value` is the measurement in words, `advice` what to do (empty when all is well)."""

    key: str
    value: str
    verdict: Verdict
    advice: str = ""

    @classmethod
    def judged(cls, key: str, value: str, is_bad: bool, advice: str) -> "Finding":
        """Return a BAD finding with its advice, or a GOOD one, which needs none."""
        return cls(key, value, Verdict.BAD, advice) if is_bad else cls(key, value, Verdict.GOOD)
