"""The tuned numbers of tracking (see `geometry.tuning`)."""

import math
from dataclasses import dataclass

from odom.geometry.tuning import BODIES, SWEEP, in_use, tuned

_HAND = "walks with a hand-held Kinect, fr1 and arena; swept in odom/docs/sensitivity.md"


# fmt: off
@dataclass(frozen=True)
class Tuning:
    """Numbers of a frame's prediction, search, fit, and of the judgement of its pose."""

    # prediction and frame_tracker
    followed: int = tuned(150, unit="features", source=SWEEP,
        effect="So many are followed by optical flow for the prediction. Fewer: fast turns are lost; more: it costs "
        "more without gain.")
    followed_least: int = tuned(15, unit="features", source=SWEEP,
        effect="A prediction needs at least so many followed features. Fewer: one is made from chance matches; more: "
        "constant velocity is used too often.")
    unsurprised_share: float = tuned(0.6, unit="share of the features", source=SWEEP,
        effect="Where patches find a larger share around the motion expected, nothing is followed by flow. Smaller: "
        "surprises and bodies that move are overlooked; larger: it costs more.")
    coarse_gate_px: float = tuned(30.0, unit="px", source=SWEEP,
        effect="The first sigma of the graduated fit to followed features. Smaller: surprises are not followed; "
        "larger: hardly anything changes.")
    middle_gate_px: float = tuned(6.0, unit="px", source=SWEEP,
        effect="The second sigma, as coarse_gate_px.")
    last_gate_px: float = tuned(1.5, unit="px", source=SWEEP,
        effect="The last sigma of that fit. Smaller: good features fall out; larger: outliers pull the coarse pose.")
    coarse_cauchy: float = tuned(4.0, unit="chi-squared", source=SWEEP,
        effect="In the coarse fit a feature with this chi-squared has half the weight. Smaller: it converges slowly; "
        "larger: outliers pull.")
    coarse_chi2: float = tuned(4.0, unit="chi-squared", source="two sigma",
        effect="A feature up to this agrees with the coarse pose. Smaller: few agree; larger: some agree by chance.")
    inlier_chi2: float = tuned(12.0, unit="chi-squared", source=".9975 quantile with 2 degrees of freedom",
        effect="A landmark beyond this does not count for the pose. Smaller: good ones are dropped; larger: wrong ones "
        "count.")
    displaced_chi2: float = tuned(40.0, unit="chi-squared", source="six sigma; fr1_rpy by a poor lens: 100 alike",
        effect="A landmark up to this counts where the camera is calibrated. Smaller: a poor lens is found again as it "
        "was; larger: more wrong ones are looked at.")
    image_noise: float = tuned(3.0, unit="grey levels", source="noise of a Kinect's image, JPEG included",
        effect="The noise of grey values that the alignment of patches assumes. Smaller: positions seem too exact; "
        "larger: too rough.")
    reference_rank: float = tuned(3.0, unit="sightings", source=SWEEP,
        effect="Landmarks of the nearest key frame are chosen as if found so often more. Smaller: the camera drifts at "
        "rest; larger: old landmarks are left out.")
    # consensus
    contested_least: int = tuned(15, unit="features", source=BODIES,
        effect="Another pose is looked for where at least so many disagree. Smaller: outliers are taken for a motion; "
        "larger: views with few features are not looked at twice.")
    contested_share: float = tuned(0.2, unit="share of the features", source=BODIES,
        effect="Another pose is looked for where a larger share disagrees. Smaller: it costs more; larger: passers-by "
        "are followed.")
    contested_votes: float = tuned(0.25, unit="share of the votes", source=BODIES,
        effect="Or where those off by more than agrees_px have a larger share of the votes. Smaller: it costs more in "
        "scenes at rest; larger: a body rich in texture that sets off is followed.")
    triples: int = tuned(100, unit="at most", source=BODIES,
        effect="So many random triples of features are tried for another pose. Fewer: a scene that shows in few "
        "features is missed; more: it costs more where people are in view.")
    followed_sigma_px: float = tuned(2.0, unit="px", source=BODIES,
        effect="Sigma of features that flow follows, when poses compete. Smaller: what is sharpest wins; larger: "
        "motions are not told apart.")
    found_sigma_px: float = tuned(1.0, unit="px", source=BODIES,
        effect="Sigma of landmarks that patches find; otherwise as followed_sigma_px.")
    member_chi2: float = tuned(25.0, unit="chi-squared", source="five sigma",
        effect="A landmark beyond this has no say for a pose that competes. Smaller: good ones have none; larger: "
        "bodies pull.")
    vote_cell_px: int = tuned(64, unit="px", source=BODIES,
        effect="Features in a square of this side share their votes. Smaller: a body rich in texture outvotes a poor "
        "scene; larger: so it does, where both share squares.")
    proven_frames: float = tuned(8.0, unit="frames", source=BODIES,
        effect="A landmark counts in full once it was found in so many. Smaller: bodies that start to move are "
        "followed; larger: the camera is held back in new surroundings.")
    far_most: float = tuned(2.0, unit="ratio to the median distance", source=BODIES,
        effect="Far features count more and near ones less, by the square of this ratio at most. Smaller: near bodies "
        "are followed; larger: a few far features decide.")
    consensus_gain: float = tuned(1.1, unit="ratio of votes", source=BODIES,
        effect="Another pose is taken where it has so many times the votes. Smaller: poses change for nothing; larger: "
        "passers-by are followed.")
    consensus_clear: float = tuned(2.0, unit="ratio of votes", source=BODIES,
        effect="With so many times the votes, features speak for another pose that were off by more than agrees_px "
        "from the fitted one, not only by more than differs_px. Smaller: poses change for nothing; larger: a slow "
        "body in view at the start is followed.")
    exact_px: float = tuned(0.5, unit="px", source="a box that is snatched from a desk",
        effect="A feature so near to where a pose puts it fits that pose exactly. Smaller: blurred views count for "
        "nothing; larger: a camera that shifts and turns explains a box that moves.")
    exact_share: float = tuned(0.5, unit="share of the votes", source="most of them",
        effect="The share that must fit exactly; as exact_px.")
    agrees_px: float = tuned(2.0, unit="px", source=BODIES,
        effect="A feature so near to where another pose puts it speaks for that. Smaller: blurred scenes lose; larger: "
        "poses change in vain.")
    differs_px: float = tuned(3.0, unit="px", source=BODIES,
        effect="It speaks for another pose only if it was off by more from the fitted one (but see consensus_clear). "
        "Smaller: poses change for nothing; larger: slow bodies pull.")
    jerk_m_s2: float = tuned(8.0, unit="m/s^2", source="accelerations of hand-held cameras, fr1",
        effect="A change of velocity at this rate halves a pose's votes. Smaller: knocks are missed; larger: bodies "
        "are followed.")
    jerk_rad_s2: float = tuned(40.0, unit="rad/s^2", source="as jerk_m_s2", effect="as jerk_m_s2")
    reach_in_doubt: float = tuned(2.0, unit="times jerk_m_s2 and jerk_rad_s2", source=BODIES,
        effect="A pose in doubt that needs a stronger jerk is refused. Smaller: quick turns among people are LOST; "
        "larger: a body that comes to be followed passes for a jerk.")
    young_s: float = tuned(0.35, unit="s", source=BODIES,
        effect="For so long after a segment began, a pose is as unsure as if the velocity had not been known. "
        "Smaller: a body in view from the start is followed; larger: quick turns are taken for other motions.")
    # other_motions
    differs_clearly_px: float = tuned(6.0, unit="px", source=BODIES,
        effect="Where another motion's features lie no farther (median) from where the camera's puts them, it counts "
        "by its share of all votes, and never as the scene's. Smaller: the camera is LOST in quick turns that bend "
        "and blur images; larger: slow bodies are followed.")
    other_cell_px: int = tuned(24, unit="px", source=BODIES,
        effect="One corner is followed in each square of this side. Smaller: it costs more; larger: motions go unseen.")
    sample_cell_px: int = tuned(64, unit="px", source="a fifth of the corners of other_cell_px",
        effect="A first look follows one corner in each square of this side. Smaller: it costs as much as the second; "
        "larger: too few are followed to tell.")
    other_far_px: float = tuned(15.0, unit="px of the half-size image", source="the window of flow",
        effect="A corner expected so far away, and not found there, is looked for where it was. Smaller: it costs "
        "more; larger: in slow streams the scene is not seen beside a body that is followed.")
    depthless_nearest_m: float = tuned(0.5, unit="m", source="no Kinect measures depth nearer than this",
        effect="What has no depth counts as at least so far away. Smaller: more motions are possible, and a body that "
        "alone has depth is followed; larger: what is near and dark denies the camera's motion.")
    body_deep: float = tuned(1.4, unit="ratio of depths", source="a person an arm's length away",
        effect="Nine tenths of a body's features are no farther than so many times its nearest tenth. Smaller: a body "
        "that alone has depth is followed; larger: somebody too near to be measured makes the camera LOST.")
    scene_least: int = tuned(30, unit="features", source=BODIES,
        effect="So many must be followed between two views before their motion counts as the camera's. Fewer: it "
        "counts by chance; more: the camera is LOST for longer in poor scenes.")
    scene_share: float = tuned(0.5, unit="share of the votes", source="most of them; " + BODIES,
        effect="A motion needs this share to be the camera's; a first look is enough if less than half of it is "
        "against. Smaller: bodies are followed; larger: the camera is LOST among people.")
    scene_alone: float = tuned(0.8, unit="share of the votes", source=BODIES,
        effect="With this share, if scene_reach holds, a motion is the camera's wherever the rest lies. Smaller: a "
        "body that fills the view is followed; larger: the camera is LOST where somebody stands behind a desk.")
    scene_reach: float = tuned(0.45, unit="share of the image", source=BODIES,
        effect="The hull of the features that agree must cover so much. Smaller: a body before a blurred scene is "
        "followed; larger: the camera is LOST where half of a view is bare.")
    scene_behind: float = tuned(1.25, unit="ratio of depths", source="550 views with bodies painted into fr1, people",
        effect="The scene must lie so many times as far as scene_rest of what does not agree. Smaller: a body that "
        "hides others is followed; larger: the camera is LOST where people walk near a wall.")
    scene_rest: float = tuned(0.75, unit="share of the rest", source=BODIES,
        effect="The share of what does not agree that must be nearer (see scene_behind). Smaller: a body that hides "
        "much, between a desk and a wall, is followed; larger: a few blurred corners of the scene speak against it.")
    # departing
    departing_neighbours: int = tuned(12, unit="landmarks", source=BODIES,
        effect="So many are judged together. Fewer: outliers take good ones along; more: limbs and small things go "
        "unseen.")
    departing_within: float = tuned(0.15, unit="share of the distance", source=BODIES,
        effect="All these neighbours lie within this share, as those of a landmark that is gone do. Smaller: somebody "
        "who sets off draws the camera along; larger: good landmarks are left out where there are few.")
    departing_share: float = tuned(0.35, unit="share of the neighbours", source=BODIES,
        effect="Landmarks are left out where this share used to be found and disagrees now. Smaller: so are good ones; "
        "larger: somebody who sets off draws the camera along.")
    # pose_solver and row_velocity
    cauchy_chi2: float = tuned(9.0, unit="chi-squared", source="three sigma",
        effect="A residual with this chi-squared has half the weight. Smaller: less information is used; larger: "
        "outliers pull.")
    row_information: float = tuned(4.0, unit="variance ratio", source="velocities of rows against truth, fr1 and arena",
        effect="Rows tell so much less of the velocity than independent errors would. Smaller: velocities tremble; "
        "larger: they lag behind.")
    # motion_model
    acceleration_memory_s: float = tuned(1.0, unit="s", source=_HAND,
        effect="How strongly the hand accelerates is learnt over so long. Smaller: the noise of the motion jumps; "
        "larger: a start or stop is smoothed away.")
    acceleration_least_linear: float = tuned(0.1, unit="m/s^2", source=_HAND,
        effect="The hand never accelerates less. Smaller: the end of a rest is seen late; larger: it trembles at rest.")
    acceleration_least_angular: float = tuned(0.6, unit="rad/s^2", source=_HAND, effect="as acceleration_least_linear")
    acceleration_linear: float = tuned(1.0, unit="m/s^2", source=_HAND,
        effect="This is expected at first. Smaller: motion is too smooth; larger: it is too rough for a second.")
    acceleration_angular: float = tuned(6.0, unit="rad/s^2", source=_HAND, effect="as acceleration_linear")
    acceleration_steady_s: float = tuned(0.1, unit="s", source=_HAND,
        effect="An acceleration lasts so long. Smaller: it is taken for noise; larger: poses overshoot at turns.")
    acceleration_least_s: float = tuned(0.025, unit="s", source="below a Kinect's period; walks drawn at 60 to 200 Hz",
        effect="Accelerations are seen over such steps at least. Shorter: what poses err by seems one at high rates; "
        "longer: starts and stops are seen late.")
    velocity_sigma_m_s: float = tuned(1.0, unit="m/s", source=_HAND,
        effect="Sigma of the velocity of a camera of which nothing is known. Smaller: fast starts are lost; larger: "
        "motion settles slowly.")
    velocity_sigma_rad_s: float = tuned(2.0, unit="rad/s", source=_HAND, effect="as velocity_sigma_m_s")
    # quality
    least_inliers: int = tuned(15, unit="landmarks", source=SWEEP,
        effect="A pose needs so many. Fewer: there are poses by chance; more: the camera is LOST in poor scenes.")
    known_enough: int = tuned(60, unit="landmarks", source="fr1 and the arena, depth cut off at .8 to 2.4 m; 30 and 60",
        effect="With so many of known depth, a pose is not fitted to those of vague depth, and needs no depth of its "
        "own frame. Fewer: where depth is seen in one part of the image only, rotations are known less well; more: "
        "bodies without depth are followed, and good poses are UNCERTAIN.")
    sure_inliers: int = tuned(30, unit="landmarks", source=SWEEP,
        effect="TRACKING needs so many. Fewer: it is said of poses with little support; more: poor scenes are "
        "UNCERTAIN.")
    least_share_left: float = tuned(0.25, unit="share of the last frame's landmarks", source=SWEEP,
        effect="So many must still be found. Smaller: a jump to a view that looks alike passes; larger: fast turns are "
        "LOST.")
    unsure_m: float = tuned(0.05, unit="m", source="a robot's half width of a doorway's margin",
        effect="A pose whose sigma is larger is UNCERTAIN: a promise to users, without effect on poses.")
    unsure_rad: float = tuned(math.radians(2.0), unit="rad", source="2 degrees", effect="as unsure_m")
    found_again: int = tuned(30, unit="landmarks", source="false recognitions in look-alike rooms of the arena",
        effect="A place is recognised by so many at least, one of a saved map surely by twice as many. Fewer: one that "
        "looks alike is taken for it; more: places are not recognised.")
    share_in_chain: float = tuned(0.2, unit="share of those looked for", source="as found_again",
        effect="A closure, with which the chain agrees, needs this share. Smaller: there are false ones; larger: true "
        "ones are refused.")
    share_with_matches: float = tuned(0.22, unit="landmarks found and matches of descriptors, of landmarks looked for",
        source="at most .18 in rooms that look alike; .27 and more after wide steps of fr1_rpy and a head-worn camera",
        effect="A place that was near a few frames ago needs this share, see share_in_chain.")
    share_without_chain: float = tuned(0.35, unit="share of those looked for", source="as found_again",
        effect="Relocalisation needs this share, see share_in_chain.")
    sure_share: float = tuned(0.5, unit="share of those looked for", source="half as much again as share_without_chain",
        effect="With a smaller share, or less than twice found_again, a place of a saved map counts only if a second "
        "frame agrees. Smaller: rooms that look alike are believed at once; larger: one more frame has no pose.")
    doubt_s: float = tuned(0.5, unit="s", source="15 frames at 30 Hz",
        effect="The second frame must agree within this time. Smaller: slow streams are never sure; larger: any motion "
        "between the two is plausible.")
    fastest_m_s: float = tuned(5.0, unit="m/s", source="a running person",
        effect="No camera moves faster. Smaller: fast motions are LOST; larger: jumps pass for motion.")
    fastest_rad_s: float = tuned(12.0, unit="rad/s", source="a flick of the wrist",
        effect="as fastest_m_s")
    near_s: float = tuned(1.0, unit="s", source="rooms that look alike are more than a metre apart",
        effect="For so long after a loss a place within a likely motion is known more easily. Smaller: the camera is "
        "LOST for longer; larger: places that look alike are taken for known ones.")
    near_periods: float = tuned(10.0, unit="frames", source="fr1_rpy and fr1_xyz at 1.5 to 2 Hz",
        effect="After so many, or near_s, descriptors know a place only if its landmarks agree. Fewer: slow streams "
        "fall to pieces; more: places that look alike are taken for known ones.")
    wide_away_m: float = tuned(0.1, unit="m", source="registrations of frames a quarter second apart against truth",
        effect="Landmarks may move a pose so far from where descriptors put it. Smaller: wide steps are LOST; larger: "
        "landmarks found by chance count.")
    wide_away_rad: float = tuned(0.1, unit="rad", source="as wide_away_m", effect="as wide_away_m")
    place_sigma: float = tuned(0.1, unit="m and rad", source="registrations of recognised places against truth",
        effect="How well a place alone shows where the camera is. Smaller: the rows' velocity is biased; larger: it is "
        "noisy.")
    # noise_check
    noise_half_landmarks: int = tuned(40, unit="landmarks", source=SWEEP,
        effect="The halves of an image are compared where both have so many. Fewer: poor fits are compared; more: "
        "calibration errors are never noticed in poor scenes.")
    noise_checked_all: int = tuned(20, unit="frames", source=SWEEP,
        effect="So many at the start are all looked at. Fewer: the noise is known later; more: the start costs more.")
    noise_check_every: int = tuned(4, unit="frames", source=SWEEP,
        effect="Later every so many are looked at. Smaller: it costs more; larger: changes of the noise are followed "
        "late.")
# fmt: on


TUNING = in_use(Tuning)
