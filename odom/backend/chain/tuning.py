"""The tuned numbers of the chain (see `geometry.tuning`)."""

from dataclasses import dataclass

from odom.geometry.tuning import in_use, tuned

_TRIAL = "trial on TUM fr1_xyz, fr1_rpy and the arena at 30 and 15 Hz"


# fmt: off
@dataclass(frozen=True)
class Tuning:
    """Numbers of the chain of successive registrations."""

    chain_least_pairs: int = tuned(10, unit="pairs",
        effect="fewer: links by chance; more: holes in the chain",
        source="trial on TUM fr1_xyz, fr1_rpy and the arena; swept in odom/docs/sensitivity.md")
    gated_pairs: int = tuned(30, unit="pairs with depth in both frames", source=_TRIAL,
        effect="from so many on wrong pairs are gated without a guess; fewer: too few for it, holes; "
        "more: the map's guess decides")
    agreeing_share: float = tuned(0.5, unit="share of the pairs", source="more than any other motion can have",
        effect="that must agree where they are not gated; smaller: links by chance; larger: holes where depth is lost")
    link_chi2: float = tuned(12.0, unit="chi-squared", source=".9975 quantile with 2 degrees of freedom",
        effect="smaller: good pairs are dropped; larger: wrong ones count")
    unsure_m: float = tuned(0.1, unit="m", source="some five times a hand's step in 1/30 s",
        effect="one sigma of a link beyond which it is a hole; smaller: holes; larger: links that say nothing")
    unsure_rad: float = tuned(0.1, unit="rad", source="as unsure_m", effect="as unsure_m")
    corner_cell_px: int = tuned(32, unit="px", source=_TRIAL,
        effect="at most one corner of the chain's own in a square of this side; smaller: slower; larger: poor scenes "
        "have too few")
    corner_renewal: float = tuned(0.5, unit="share of the features", source=_TRIAL + ": drift over 1 s",
        effect="that are left when new corners are cut; smaller: few pairs; larger: patches change often, and the "
        "chain drifts")
    plenty_pairs: int = tuned(80, unit="pairs", source=_TRIAL,
        effect="below which corners are followed from the frame before; fewer: links of few pairs drift in fast turns; "
        "more: slower")
    followed_back_px: float = tuned(1.0, unit="px", source=_TRIAL,
        effect="how closely a corner must be followed back to where it began; smaller: few in blurred images; larger: "
        "slips")
    corner_misses: int = tuned(5, unit="frames", source=_TRIAL + ": drift over 1 s",
        effect="in a row after which a corner is given up; fewer: patches change often; more: slower")
    corner_farthest_m: float = tuned(8.0, unit="m", source="the range of a Kinect",
        effect="smaller: halls have no corners; larger: depth that is mostly noise")
    closure_every_s: float = tuned(0.3, unit="s", source=_TRIAL,
        effect="smaller: slower, and what closures share counts several times; larger: less to hold the chain by")
    closure_after_s: float = tuned(1.0, unit="s", source=_TRIAL,
        effect="smaller: closures that repeat links; larger: short loops stay open")
    closures_each: int = tuned(3, unit="closures a node", source=_TRIAL,
        effect="fewer: less to hold the chain by; more: slower, and what they share counts several times")
    closure_least: int = tuned(30, unit="landmarks in common", source=_TRIAL,
        effect="fewer: rough closures; more: loops stay open")
    closed_most_nodes: int = tuned(1000, unit="nodes", source="some 3 MB; five minutes, thinned beyond",
        effect="fewer: long walks are closed roughly; more: memory")
    hole_sigma: float = tuned(10.0, unit="m and rad", source="far more than any motion over a hole",
        effect="smaller: a hole counts as if the camera had stood still; larger: nothing")
# fmt: on


TUNING = in_use(Tuning)
