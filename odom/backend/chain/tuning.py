"""The tuned numbers of the chain (see `geometry.tuning`)."""

from dataclasses import dataclass

from odom.geometry.tuning import in_use, tuned

_TRIAL = "trial on TUM fr1_xyz, fr1_rpy and the arena at 30 and 15 Hz"


# fmt: off
@dataclass(frozen=True)
class Tuning:
    """Numbers of the chain of successive registrations."""

    chain_least_pairs: int = tuned(10, unit="pairs",
        effect="A link needs at least so many pairs that agree. Fewer: links are made by chance; more: the chain has "
        "more holes.",
        source="trial on TUM fr1_xyz, fr1_rpy and the arena; swept in odom/docs/sensitivity.md")
    gated_pairs: int = tuned(30, unit="pairs with depth in both frames", source=_TRIAL,
        effect="From so many on, wrong pairs are gated without an initial guess. Fewer: the gate finds no motion in "
        "so few, and leaves holes; more: the motion guessed from the map decides.")
    agreeing_share: float = tuned(0.5, unit="share of the pairs", source="more than any other motion can have",
        effect="Where pairs are not gated, this share must agree on a motion. Smaller: links are made by chance; "
        "larger: there are holes where depth is lost.")
    link_chi2: float = tuned(12.0, unit="chi-squared", source=".9975 quantile with 2 degrees of freedom",
        effect="A pair beyond this does not count for a link. Smaller: good pairs are dropped; larger: wrong ones "
        "count.")
    unsure_m: float = tuned(0.1, unit="m", source="some five times a hand's step in 1/30 s",
        effect="A link whose sigma is larger counts as a hole. Smaller: there are more holes; larger: some links say "
        "nothing.")
    unsure_rad: float = tuned(0.1, unit="rad", source="as unsure_m", effect="as unsure_m")
    corner_cell_px: int = tuned(32, unit="px", source=_TRIAL,
        effect="The chain adds at most one corner of its own in each square of this side. Smaller: it costs more; "
        "larger: poor scenes have too few.")
    corner_renewal: float = tuned(0.5, unit="share of the features", source=_TRIAL + ": drift over 1 s",
        effect="New corners are cut once the share of features left falls to this. Smaller: links have few pairs; "
        "larger: patches change often, and the chain drifts.")
    plenty_pairs: int = tuned(80, unit="pairs", source=_TRIAL,
        effect="With fewer pairs in a link, corners are also followed from the frame before. Fewer: links of few "
        "pairs drift in fast turns; more: it costs more.")
    followed_back_px: float = tuned(1.0, unit="px", source=_TRIAL,
        effect="A corner that is followed forth and back must end this near to where it began. Smaller: few do in "
        "blurred images; larger: corners that slipped are kept.")
    corner_misses: int = tuned(5, unit="frames", source=_TRIAL + ": drift over 1 s",
        effect="A corner is given up after so many misses in a row. Fewer: patches change often; more: it costs "
        "more.")
    corner_farthest_m: float = tuned(8.0, unit="m", source="the range of a Kinect",
        effect="No corner is cut farther away. Smaller: halls have none; larger: depth that is mostly noise is used.")
    closure_every_s: float = tuned(0.3, unit="s", source=_TRIAL,
        effect="After this time at the latest a frame becomes a node that can be closed. Smaller: it costs more, and "
        "errors that closures share count several times; larger: less holds the chain.")
    closure_after_s: float = tuned(1.0, unit="s", source=_TRIAL,
        effect="A closure goes back at least so far in time. Smaller: closures repeat what links say; larger: short "
        "loops stay open.")
    closures_each: int = tuned(3, unit="closures a node", source=_TRIAL,
        effect="Each node is closed with at most so many older ones. Fewer: less holds the chain; more: it costs "
        "more, and errors that closures share count several times.")
    closure_least: int = tuned(30, unit="landmarks in common", source=_TRIAL,
        effect="A closure needs at least so many. Fewer: closures are rough; more: loops stay open.")
    closed_most_nodes: int = tuned(1000, unit="nodes", source="some 3 MB; five minutes, thinned beyond",
        effect="Beyond so many, every second node of the older half is dropped. Fewer: long walks are closed "
        "roughly; more: memory.")
    hole_sigma: float = tuned(10.0, unit="m and rad", source="far more than any motion over a hole",
        effect="One sigma of the motion over a hole in the chain. Smaller: the camera counts as having stood still "
        "there; larger: nothing changes.")
# fmt: on


TUNING = in_use(Tuning)
