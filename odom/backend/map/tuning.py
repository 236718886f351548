"""The tuned numbers of the map (see `geometry.tuning`)."""

from dataclasses import dataclass

from odom.geometry.tuning import SWEEP, in_use, tuned


# fmt: off
@dataclass(frozen=True)
class Tuning:
    """Numbers of key frames, landmarks and the covariances of motions between frames."""

    anchor_share: float = tuned(0.1, unit="share of a ray's variance", source=SWEEP,
        effect="Only this share counts across the ray of a new landmark, since its patch is cut where it was "
        "measured. Smaller: NEES rises; larger: it falls.")
    vague_depth: float = tuned(0.03, unit="share of the depth (sigma)",
        source="three walks of the arena and fr1, depth cut off at 1 to 2.4 m",
        effect="An assumed depth is vague until it is known so well. Smaller: landmarks count for little for longer; "
        "larger: what they err by alike is taken for a step of the camera.")
    link_landmarks: int = tuned(15, unit="landmarks", source=SWEEP,
        effect="Key frames are linked by so many in common. Fewer: landmarks of distant key frames are searched in "
        "vain; more: those of near ones are missed.")
    neighbour_hops: int = tuned(3, unit="links", source=SWEEP,
        effect="Landmarks are looked for in key frames up to so many links away. Fewer: key frames in view are "
        "missed; more: it costs more in maps with many links.")
    recalled: int = tuned(12, unit="key frames", source="local_keyframes, and two to come",
        effect="So many around the camera are brought back from a saved map. Fewer: landmarks in view are missing; "
        "more: frames wait for the disk.")
    cull_trials: int = tuned(8, unit="frames", source=SWEEP,
        effect="A landmark is judged by how often it was found after it was looked for in so many. Fewer: good ones "
        "are removed after a blur; more: bad ones are looked for in place of good ones for longer.")
    cull_share: float = tuned(0.25, unit="share of trials", source=SWEEP,
        effect="A landmark found in a smaller share is removed. Smaller: bad ones stay; larger: those that are seen "
        "from one side only are removed.")
    shared_error: float = tuned(0.8, unit="ratio of variances",
        source="motions over .1 to 10 s against truth, fr1 and arena",
        effect="How large the errors that neighbouring frames share are, against the error of a single frame. "
        "Smaller: NEES of long motions rises; larger: it falls.")
    shared_error_s: float = tuned(0.5, unit="s", source="motions over .1 to 10 s against truth, fr1 and arena",
        effect="Shared errors fade in this time, as the camera looks elsewhere. Smaller: NEES of motions of about "
        "this length falls; larger: it rises.")
    unit_of_length: float = tuned(0.02, unit="share of a motion (sigma)",
        source="the depth of the TUM benchmark's three Kinects was found to be off by 3.5, 3.1 and 0 %; eight walks in "
        "the arena with depth 2 % off",
        effect="The error of the unit of depth that covariances of motions include. Smaller: where the unit is "
        "wrong, NEES of motions of a metre and more is 15 and higher; larger: motions along a line are claimed to be "
        "less sure than they are.")
# fmt: on


TUNING = in_use(Tuning)
