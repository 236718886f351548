"""The tuned numbers of loop closure (see `geometry.tuning`)."""

from dataclasses import dataclass

from odom.geometry.tuning import in_use, tuned


@dataclass(frozen=True)
class Tuning:
    """Numbers by which closures are judged."""

    chain_sigma_scale: float = tuned(
        2.0,
        unit="1",
        effect="sigmas of chain and closure count so much; smaller: true closures are refused; larger: false ones pass",
        source="false recognitions in look-alike rooms of the arena",
    )


TUNING = in_use(Tuning)
