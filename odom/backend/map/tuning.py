"""The tuned numbers of the map (see `geometry.tuning`)."""

from dataclasses import dataclass

from odom.geometry.tuning import in_use, tuned

_SWEEP = "trial on TUM fr1_xyz, fr1_rpy and the arena; swept in odom/docs/sensitivity.md"


# fmt: off
@dataclass(frozen=True)
class Tuning:
    """Numbers of key frames, landmarks and the covariances of motions between frames."""

    anchor_share: float = tuned(0.1, unit="share of a ray's variance", source=_SWEEP,
        effect="a new landmark's patch is cut where it was measured, by definition; smaller: NEES rises; larger: falls")
    link_landmarks: int = tuned(15, unit="landmarks", source=_SWEEP,
        effect="common landmarks that link key frames; fewer: far ones are searched in vain; "
        "more: near ones are missed")
    neighbour_hops: int = tuned(3, unit="links", source=_SWEEP,
        effect="fewer: key frames in view are missed; more: slower on maps with many links")
    recalled: int = tuned(12, unit="key frames", source="local_keyframes, and two to come",
        effect="brought back around the camera in a saved map; fewer: landmarks in view are missing; "
        "more: frames wait for the disk")
    cull_trials: int = tuned(8, unit="frames", source=_SWEEP,
        effect="fewer: good landmarks go after a blur; more: bad ones take their place in the search for longer")
    cull_share: float = tuned(0.25, unit="share of trials", source=_SWEEP,
        effect="smaller: bad landmarks stay; larger: those seen from one side only go")
    shared_error: float = tuned(0.8, unit="ratio of variances",
        source="motions over .1 to 10 s against truth, fr1 and arena",
        effect="errors that frames share against a frame's own; smaller: NEES of long motions rises; larger: it falls")
    shared_error_s: float = tuned(0.5, unit="s", source="motions over .1 to 10 s against truth, fr1 and arena",
        effect="time over which shared errors fade, as the camera looks elsewhere; as above for motions of this length")
    unit_of_length: float = tuned(0.02, unit="share of a motion (sigma)",
        source="the depth of the TUM benchmark's three Kinects was found to be off by 3.5, 3.1 and 0 %; eight walks in "
        "the arena with depth 2 % off",
        effect="smaller: where the unit of depth is not right, NEES of motions of a metre and more is 15 and higher; "
        "larger: motions along a line are claimed to be less sure than they are")
# fmt: on


TUNING = in_use(Tuning)
