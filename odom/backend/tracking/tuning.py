"""The tuned numbers of tracking (see `geometry.tuning`)."""

import math
from dataclasses import dataclass

from odom.geometry.tuning import in_use, tuned

_SWEEP = "trial on TUM fr1_xyz, fr1_rpy and the arena; swept in odom/docs/sensitivity.md"
_HAND = "walks with a hand-held Kinect, fr1 and arena; swept in odom/docs/sensitivity.md"

_BODIES = "bodies painted into fr1_xyz and fr1_rpy, people in the arena, fr1 as it is"


# fmt: off
@dataclass(frozen=True)
class Tuning:
    """Numbers of a frame's prediction, search, fit, and of the judgement of its pose."""

    # prediction and frame_tracker
    followed: int = tuned(150, unit="features", source=_SWEEP,
        effect="followed by optical flow for the prediction; fewer: fast turns are lost; more: slower without gain")
    followed_least: int = tuned(15, unit="features", source=_SWEEP,
        effect="fewer: a prediction from chance matches; more: the constant velocity is used too often")
    unsurprised_share: float = tuned(0.6, unit="share of the features", source=_SWEEP,
        effect="found by patches around the motion expected, nothing need be followed; smaller: surprises and bodies "
        "that move are overlooked; larger: slower")
    coarse_gate_px: float = tuned(30.0, unit="px", source=_SWEEP,
        effect="first sigma of graduated non-convexity; smaller: surprises are not followed; larger: hardly anything")
    middle_gate_px: float = tuned(6.0, unit="px", source=_SWEEP, effect="second sigma; as coarse_gate_px")
    last_gate_px: float = tuned(1.5, unit="px", source=_SWEEP,
        effect="last sigma; smaller: good features fall out; larger: the coarse pose is pulled by outliers")
    coarse_cauchy: float = tuned(4.0, unit="chi-squared", source=_SWEEP,
        effect="where the coarse fit's weight is one half; smaller: slow to converge; larger: outliers pull")
    coarse_chi2: float = tuned(4.0, unit="chi-squared", source="two sigma",
        effect="features that agree with the coarse pose; smaller: fewer agree; larger: chance agrees")
    inlier_chi2: float = tuned(12.0, unit="chi-squared", source=".9975 quantile with 2 degrees of freedom",
        effect="smaller: good landmarks are dropped; larger: wrong ones count")
    displaced_chi2: float = tuned(40.0, unit="chi-squared", source="six sigma; fr1_rpy by a poor lens: 100 alike",
        effect="up to which a landmark counts where the camera is calibrated; smaller: a poor lens is found again; "
        "larger: more of what is wrong is looked at")
    image_noise: float = tuned(3.0, unit="grey levels", source="noise of a Kinect's image, JPEG included",
        effect="smaller: aligned positions seem too exact; larger: too rough")
    reference_rank: float = tuned(3.0, unit="sightings", source=_SWEEP,
        effect="head start of the nearest key frame's landmarks; smaller: drift at rest; "
        "larger: old landmarks are left out")
    # consensus
    contested_least: int = tuned(15, unit="features", source=_BODIES,
        effect="smaller: chance outliers are taken for a motion; larger: small views are not looked at twice")
    contested_share: float = tuned(0.2, unit="share of the features", source=_BODIES,
        effect="that disagree before another pose is looked for; smaller: slower; larger: passers-by are followed")
    triples: int = tuned(100, unit="at most", source=_BODIES,
        effect="fewer: a scene that shows in few features is missed; more: slower where people are in view")
    followed_sigma_px: float = tuned(2.0, unit="px", source=_BODIES,
        effect="of features followed by flow; smaller: what is sharpest wins; larger: motions are not told apart")
    found_sigma_px: float = tuned(1.0, unit="px", source=_BODIES, effect="of landmarks found; as followed_sigma_px")
    member_chi2: float = tuned(25.0, unit="chi-squared", source="five sigma",
        effect="off so far a landmark has no say where poses compete; smaller: good ones go; larger: bodies pull")
    vote_cell_px: int = tuned(64, unit="px", source=_BODIES,
        effect="side of a cell that shares its votes; smaller: one rich body outvotes a poor scene; larger: as well")
    proven_frames: float = tuned(8.0, unit="frames", source=_BODIES,
        effect="in which a landmark was found until it counts in full; smaller: bodies that start to move are "
        "followed; larger: the camera is held back in new surroundings")
    far_most: float = tuned(2.0, unit="ratio to the median distance", source=_BODIES,
        effect="up to which far features count more and near ones less, by its square; smaller: near bodies are "
        "followed; larger: a few far features decide")
    consensus_gain: float = tuned(1.1, unit="ratio of votes", source=_BODIES,
        effect="smaller: poses change for nothing; larger: passers-by are followed")
    exact_px: float = tuned(0.5, unit="px", source="a box that is snatched from a desk",
        effect="features so near to a pose lie just there; smaller: blurred views count for nothing; larger: a camera "
        "that shifts and turns explains a box that moves")
    exact_share: float = tuned(0.5, unit="share of the votes", source="most of them", effect="as exact_px")
    agrees_px: float = tuned(2.0, unit="px", source=_BODIES,
        effect="features so near win for another pose; smaller: blurred scenes lose; larger: poses change in vain")
    differs_px: float = tuned(3.0, unit="px", source=_BODIES,
        effect="that were off so far before; smaller: poses change for nothing; larger: slow bodies pull")
    jerk_m_s2: float = tuned(8.0, unit="m/s^2", source="accelerations of hand-held cameras, fr1",
        effect="a change of velocity that halves the votes; smaller: knocks are missed; larger: bodies are followed")
    jerk_rad_s2: float = tuned(40.0, unit="rad/s^2", source="as jerk_m_s2", effect="as jerk_m_s2")
    reach_in_doubt: float = tuned(2.0, unit="times jerk_m_s2 and jerk_rad_s2", source=_BODIES,
        effect="beyond which a pose in doubt is none; smaller: quick turns among people are LOST; larger: a body that "
        "comes to be followed passes for a jerk")
    # other_motions
    other_cell_px: int = tuned(24, unit="px", source=_BODIES,
        effect="side of a square with one corner that is followed; smaller: slower; larger: motions go unseen")
    other_back_px: float = tuned(0.5, unit="px of the half-size image", source="as look_back_return_px of the search",
        effect="followed there and back; smaller: bodies are not found again; larger: chance counts")
    scene_least: int = tuned(30, unit="features", source=_BODIES,
        effect="followed between two views before their motion counts as the camera's; fewer: chance; more: LOST for "
        "longer in poor scenes")
    scene_share: float = tuned(0.5, unit="share of the votes", source="most of them; " + _BODIES,
        effect="that a motion must have to be the camera's; smaller: bodies are followed; larger: LOST among people")
    scene_alone: float = tuned(0.8, unit="share of the votes", source=_BODIES,
        effect="with which it is the camera's wherever the rest lies, if scene_reach; smaller: a body that fills the "
        "view is followed; larger: LOST where somebody stands behind a desk")
    scene_reach: float = tuned(0.45, unit="share of the image", source=_BODIES,
        effect="inside the hull of what agrees; smaller: a body before a blurred scene is followed; larger: LOST where "
        "half of a view is bare")
    scene_behind: float = tuned(1.25, unit="ratio of depths", source="550 views with bodies painted into fr1, people",
        effect="by which it lies farther than scene_rest of the rest; smaller: a body that hides others is "
        "followed; larger: LOST where people walk near a wall")
    scene_rest: float = tuned(0.75, unit="share of the rest", source=_BODIES,
        effect="that must be so much nearer; smaller: a body that hides much, between a desk and a wall, is followed; "
        "larger: a few blurred corners of the scene speak against it")
    # departing
    departing_neighbours: int = tuned(12, unit="landmarks", source=_BODIES,
        effect="judged together; fewer: chance outliers take good ones along; more: limbs and small things go unseen")
    departing_within: float = tuned(0.15, unit="share of the distance", source=_BODIES,
        effect="within which all these neighbours lie; smaller: who sets off draws the camera along; larger: good "
        "landmarks are left out where there are few")
    departing_share: float = tuned(0.35, unit="share of the neighbours", source=_BODIES,
        effect="that used to be found and now disagree; smaller: good landmarks are left out; larger: who sets off "
        "draws the camera along")
    # pose_solver and row_velocity
    cauchy_chi2: float = tuned(9.0, unit="chi-squared", source="three sigma",
        effect="where a residual's weight is one half; smaller: less information is used; larger: outliers pull")
    row_information: float = tuned(4.0, unit="variance ratio", source="velocities of rows against truth, fr1 and arena",
        effect="how much less rows tell of the velocity than independent errors would; smaller: velocities "
        "tremble; larger: lag")
    # motion_model
    agility_memory_s: float = tuned(1.0, unit="s", source=_HAND,
        effect="smaller: the noise of the motion jumps; larger: a start or stop is smoothed away")
    agility_least_linear: float = tuned(0.1, unit="m/s^2", source=_HAND,
        effect="smaller: a camera at rest is taken up late; larger: it trembles at rest")
    agility_least_angular: float = tuned(0.6, unit="rad/s^2", source=_HAND, effect="as agility_least_linear")
    agility_linear: float = tuned(1.0, unit="m/s^2", source=_HAND,
        effect="acceleration expected at the start; smaller: too smooth; larger: too rough for a second")
    agility_angular: float = tuned(6.0, unit="rad/s^2", source=_HAND, effect="as agility_linear")
    agility_steady_s: float = tuned(0.1, unit="s", source=_HAND,
        effect="how long an acceleration lasts; smaller: white noise; "
        "larger: poses overshoot when the hand turns round")
    velocity_sigma_m_s: float = tuned(1.0, unit="m/s", source=_HAND,
        effect="velocity expected of a camera of which nothing is known; smaller: fast starts are lost; "
        "larger: slow to settle")
    velocity_sigma_rad_s: float = tuned(2.0, unit="rad/s", source=_HAND, effect="as velocity_sigma_m_s")
    # quality
    least_inliers: int = tuned(15, unit="landmarks", source=_SWEEP,
        effect="fewer: poses by chance; more: LOST in poor scenes")
    sure_inliers: int = tuned(30, unit="landmarks", source=_SWEEP,
        effect="fewer: TRACKING on little; more: UNCERTAIN in poor scenes")
    least_share_left: float = tuned(0.25, unit="share of the last frame's landmarks", source=_SWEEP,
        effect="smaller: a jump to a look-alike view passes; larger: fast turns are LOST")
    unsure_m: float = tuned(0.05, unit="m", source="a robot's half width of a doorway's margin",
        effect="one sigma of a pose beyond which it is UNCERTAIN; a promise to users, no effect on poses")
    unsure_rad: float = tuned(math.radians(2.0), unit="rad", source="2 degrees", effect="as unsure_m")
    found_again: int = tuned(30, unit="landmarks", source="false recognitions in look-alike rooms of the arena",
        effect="fewer: look-alike places are taken for known ones; more: places are not recognised")
    share_in_chain: float = tuned(0.2, unit="share of those looked for", source="as found_again",
        effect="for closures, where the chain must agree as well; smaller: false closures; larger: true ones refused")
    share_with_matches: float = tuned(0.22, unit="landmarks found and matches of descriptors, of landmarks looked for",
        source="at most .18 in rooms that look alike; .27 and more after wide steps of fr1_rpy and a head-worn camera",
        effect="by which a camera is known that was near a few frames ago; as share_in_chain")
    share_without_chain: float = tuned(0.35, unit="share of those looked for", source="as found_again",
        effect="for relocalisation; as share_in_chain")
    sure_found_again: int = tuned(60, unit="landmarks", source="twice found_again",
        effect="in a saved map, below, a second frame must agree; smaller: look-alike rooms are believed at once; "
        "larger: one more frame without a pose")
    sure_share: float = tuned(0.5, unit="share of those looked for", source="half as much again as share_without_chain",
        effect="as sure_found_again")
    doubt_s: float = tuned(0.5, unit="s", source="15 frames at 30 Hz",
        effect="within this time the second frame must agree; smaller: slow streams are never sure; larger: any motion "
        "is plausible")
    fastest_m_s: float = tuned(5.0, unit="m/s", source="a running person",
        effect="smaller: fast motions are LOST; larger: jumps pass for motion")
    fastest_rad_s: float = tuned(12.0, unit="rad/s", source="a flick of the wrist",
        effect="as fastest_m_s")
    near_s: float = tuned(1.0, unit="s", source="rooms that look alike are more than a metre apart",
        effect="of a likely motion within which a place is known more easily; smaller: LOST for longer; larger: "
        "look-alike places are taken for known ones")
    near_periods: float = tuned(10.0, unit="frames", source="fr1_rpy and fr1_xyz at 1.5 to 2 Hz",
        effect="after so many, or near_s, a place is known by descriptors only if its landmarks agree; fewer: slow "
        "streams fall to pieces; more: look-alike places are taken for known ones")
    wide_away_m: float = tuned(0.1, unit="m", source="registrations of frames a quarter second apart against truth",
        effect="how far landmarks may move a pose from where descriptors put it; smaller: wide steps are LOST; "
        "larger: chance landmarks count")
    wide_away_rad: float = tuned(0.1, unit="rad", source="as wide_away_m", effect="as wide_away_m")
    place_sigma: float = tuned(0.1, unit="m and rad", source="registrations of recognised places against truth",
        effect="how well a place alone shows where the camera is; smaller: the rows' velocity is biased; larger: noisy")
    # noise_check
    noise_half_landmarks: int = tuned(40, unit="landmarks", source=_SWEEP,
        effect="fewer: halves compared by poor fits; more: calibration errors are never noticed in poor scenes")
    noise_checked_all: int = tuned(20, unit="frames", source=_SWEEP,
        effect="frames at the start that are all looked at; fewer: noise is known later; more: slower start")
    noise_check_every: int = tuned(4, unit="frames", source=_SWEEP,
        effect="smaller: slower; larger: noise is followed later")
# fmt: on


TUNING = in_use(Tuning)
