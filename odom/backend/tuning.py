"""The tuned number of the chain (see `geometry.tuning`)."""

from dataclasses import dataclass

from odom.geometry.tuning import in_use, tuned


@dataclass(frozen=True)
class Tuning:
    """Numbers of the chain of successive registrations."""

    chain_least_pairs: int = tuned(
        10,
        unit="pairs",
        effect="fewer: links by chance; more: holes in the chain",
        source="trial on TUM fr1_xyz, fr1_rpy and the arena; swept in odom/docs/sensitivity.md",
    )


TUNING = in_use(Tuning)
