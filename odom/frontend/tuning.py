"""The tuned numbers of the front-end (see `geometry.tuning`)."""

from dataclasses import dataclass

from odom.geometry.tuning import in_use, tuned

_SWEEP = "trial on TUM fr1_xyz, fr1_rpy and the arena; swept in odom/docs/sensitivity.md"
_KINECT = "what Kinect v1 streams show; swept in odom/docs/sensitivity.md"

_BODIES = "bodies painted into fr1_xyz and fr1_rpy, people in the arena, fr1 as it is"


# fmt: off
@dataclass(frozen=True)
class Tuning:
    """Numbers of camera model, features and matching."""

    # stamp_clock
    clock_window: int = tuned(30, unit="stamps", source=_KINECT,
        effect="The line of steady time is fitted to so many. Fewer: it keeps more jitter; more: a clock that drifts "
        "is followed late.")
    clock_least: int = tuned(6, unit="stamps", source=_KINECT,
        effect="The line needs at least so many. Fewer: it is fitted to too little; more: the first frames keep "
        "their jitter for longer.")
    clock_longest_gap_s: float = tuned(0.5, unit="s", source=_KINECT,
        effect="After a longer gap the line begins anew. Smaller: it does so after a few lost frames; larger: "
        "periods are miscounted over a gap.")
    clock_longest_gap_periods: float = tuned(2.5, unit="periods", source="one lost frame and its jitter",
        effect="As clock_longest_gap_s, in a slow stream: so many periods count where they are longer.")
    clock_slowest_s: float = tuned(2.0, unit="s", source="one frame a second, of which one is lost",
        effect="The longest period that is learnt. Smaller: each frame of a slow stream seems to follow a gap; "
        "larger: two gaps in a row of a quick stream pass for its period.")
    clock_gain: float = tuned(0.2, unit="1", source=_KINECT,
        effect="While periods are counted, this share of a stamp's error is taken over. Smaller or larger: a period "
        "is miscounted.")
    clock_most_unsteady: float = tuned(0.25, unit="share of a period", source=_KINECT,
        effect="Stamps that jitter more are taken as they are. Smaller: jittery clocks are not smoothed; larger: a "
        "line is drawn through stamps that have no period.")
    clock_most_late_s: float = tuned(0.02, unit="s", source="recordings at 30 Hz that were thinned: 33 ms and more",
        effect="The line begins anew after a stamp that is off it by more. Smaller: late stamps of streams below 25 "
        "Hz are believed; larger: a frame missing before a slow stream was thinned out shifts the poses after it.")
    clock_outlier: float = tuned(3.0, unit="sigma", source="three sigma of a normal distribution",
        effect="A stamp farther off does not count for the line. Smaller: good stamps are left out; larger: late "
        "ones bend it.")
    clock_unknown: float = tuned(0.05, unit="share of a period", source=_KINECT,
        effect="One sigma of a stamp at the start. Smaller: the first seconds are too sure; larger: they are too "
        "unsure.")
    # noise_monitor
    noise_gain: float = tuned(0.05, unit="1 a frame", source=_SWEEP,
        effect="The weight of the newest frame where noise is learnt. Smaller: it is learnt late; larger: the "
        "covariance trembles with each frame.")
    noise_least: int = tuned(15, unit="residuals", source=_SWEEP,
        effect="Noise is learnt from at least so many at a time. Fewer: medians are of too few; more: the noise of "
        "depth far away is never learnt.")
    noise_range: float = tuned(8.0, unit="1", source="bounds far beyond any camera met so far",
        effect="The noise may be so many times larger or smaller than assumed at first. Smaller: other cameras are "
        "misjudged; larger: it takes longer to come back.")
    noise_unproven: float = tuned(5.0, unit="variance ratio", source=_SWEEP,
        effect="Covariances are inflated so much before anything was seen. Smaller: the first poses are too sure; "
        "larger: they are too unsure.")
    noise_most: float = tuned(50.0, unit="variance ratio", source=_SWEEP,
        effect="Comparing the halves of one frame says at most this. Smaller: errors of calibration are underrated; "
        "larger: one bad frame counts for long.")
    noise_most_jump: float = tuned(100.0, unit="variance ratio", source=_SWEEP,
        effect="One jump between poses says at most this; otherwise as noise_most.")
    noise_calibration_error: float = tuned(0.025, unit="share of a motion",
        source="default Kinect intrinsics against calibrated",
        effect="The error of a long motion where the calibration is wrong. Smaller: such motions are too sure; "
        "larger: false loop closures pass.")
    noise_explained: float = tuned(3.0, unit="variance ratio", source=_SWEEP,
        effect="Noise alone explains an inflation up to this. Smaller: the calibration is blamed too soon; larger: "
        "too late.")
    tilt_sigma: float = tuned(0.02, unit="rad", source="two cameras are mounted to a degree; fr1's: 1.6 degrees",
        effect="How far the axis of depth may be turned against the colour camera's, before anything is seen. "
        "Smaller: a tilt is found late; larger: a first glimpse is taken for one.")
    tilt_odds: float = tuned(20.0, unit="1", source="strong evidence as R. Kass, A. Raftery 1995 call it",
        effect="From this Bayes factor on, the axis of depth counts as turned. Smaller: noise bends walks that "
        "hardly show a tilt; larger: a tilt is found late.")
    tilt_odds_at_once: float = tuned(1e4, unit="1",
        source="between windows of a time-of-flight camera, whose depth errs in rings, and a Kinect's with a tilt",
        effect="As tilt_odds, by the frames of a single adjustment, whose errors may be alike. Smaller: another "
        "fault of depth is taken for a tilt; larger: a tilt bends the first second of a walk.")
    timing_restart_s: float = tuned(0.001, unit="s", source="assumed of a device that was switched off and on",
        effect="How far a camera's timing may change from one session to the next. Smaller: a changed device is "
        "learnt slowly; larger: the timing is learnt anew each time.")
    timing_memory: float = tuned(0.95, unit="1 an adjustment", source=_SWEEP,
        effect="So much of what was known of the timing is kept at each adjustment. Smaller: shutter and lag stay "
        "noisy; larger: changes are followed late.")
    # corners
    corner_border_px: int = tuned(14, unit="px", source="radius of a patch (12 px) and 2 px",
        effect="No corner is nearer to the border. Smaller: patches reach beyond the image; larger: features at the "
        "border, which tell rotation best, are lost.")
    corner_apart_px: int = tuned(10, unit="px", source=_SWEEP,
        effect="No corner is nearer to another. Smaller: new corners repeat old ones; larger: gaps are not filled.")
    corner_weakest: float = tuned(4e-5, unit="grey^2 of OpenCV's cornerMinEigenVal", source=_SWEEP,
        effect="A weaker corner is not used. Smaller: there are corners in noise; larger: poor scenes have too few.")
    corner_over_noise: float = tuned(1.2e-5, unit="cornerMinEigenVal of one grey level of noise",
        source="the strongest of an image of white noise, 1.1e-5",
        effect="As corner_weakest, times the variance of the image's noise. Smaller: there are corners in noise; "
        "larger: faint corners of noisy images are left out.")
    # depth_plane
    depth_share_valid: float = tuned(0.5, unit="share of 7 x 7 pixels", source=_SWEEP,
        effect="A plane needs depth in at least this share. Smaller: it is fitted to too little; larger: depth with "
        "holes is not used.")
    depth_share_on_surface: float = tuned(0.85, unit="share of measured pixels", source=_SWEEP,
        effect="At least this share must lie on the plane. Smaller: mixed pixels at depth edges are used; larger: "
        "rough surfaces are not.")
    depth_step: float = tuned(0.03, unit="share of the depth", source=_SWEEP,
        effect="Depth that is farther off the plane lies on another surface. Smaller: steep surfaces count as edges; "
        "larger: edges count as surfaces.")
    depth_least_share: float = tuned(0.01, unit="share of the image",
        source="a Kinect close to a wall still shows some per cent",
        effect="An image with less has no depth. Smaller: noise counts as depth; larger: a view into the distance "
        "counts as blind.")
    # images: taken in the dark
    image_contrast: float = tuned(30.0, unit="grey levels (standard deviation)",
        source="below that of every recording in the light (38 to 100); `odom bench robustness --axis darkness`",
        effect="An image with less contrast is amplified to this. Smaller: dark images stay faint; larger: good ones "
        "are changed.")
    image_clean: float = tuned(3.0, unit="grey levels", source="noise of a Kinect's image, JPEG included",
        effect="Noise up to this needs no smoothing. Smaller: detail is smoothed away; larger: landmarks drown in "
        "noise.")
    image_smooth_px: float = tuned(1.0, unit="px", source="`odom bench robustness --axis darkness`",
        effect="Sigma of the smoothing. Smaller: noise is left; larger: corners are smoothed away.")
    # images: pyramidal Lucas-Kanade
    flow_window_px: int = tuned(15, unit="px", source=_SWEEP,
        effect="Side of the window that flow matches. Smaller: blurred features are lost; larger: it costs more, and "
        "the two sides of a depth edge mix.")
    flow_levels: int = tuned(3, unit="pyramid levels", source=_SWEEP,
        effect="Flow begins so many halvings of the image up. Fewer: quick turns are lost; more: it costs more "
        "without gain.")
    flow_iterations: int = tuned(12, unit="1", source=_SWEEP,
        effect="Flow makes at most so many steps a level. Fewer: the coarse pose is rough; more: it costs more "
        "without gain.")
    # patches
    patch_least_contrast: float = tuned(5.0, unit="grey^2 (variance)",
        source="noise of a Kinect's image, about 2 grey levels",
        effect="A patch with less is not aligned. Smaller: patches of noise are; larger: dark scenes lose landmarks.")
    patch_least_gain: float = tuned(0.2, unit="1", source=_SWEEP,
        effect="A patch must be found with at least this share of its contrast. Smaller: it matches faint texture by "
        "chance; larger: landmarks are lost when the exposure changes.")
    patch_converged_px: float = tuned(0.02, unit="px", source="a twentieth of the noise",
        effect="The alignment of a patch ends with a smaller step. Smaller: it costs more; larger: positions are "
        "rougher.")
    warp_step_px: float = tuned(4.0, unit="px", source="a third of a patch's radius",
        effect="Step of the numerical derivative of the warp. Smaller or larger: hardly anything changes.")
    warp_smallest_area: float = tuned(0.15, unit="ratio of areas", source=_SWEEP,
        effect="A patch is not shrunk further. Smaller: patches are shrunk to a blur; larger: landmarks are lost "
        "when the camera backs off.")
    warp_largest_area: float = tuned(6.0, unit="ratio of areas", source=_SWEEP,
        effect="A patch is not magnified further. Smaller: landmarks are lost when the camera comes near; larger: "
        "magnified blur is matched.")
    # landmark_search
    search_margin_px: float = tuned(8.0, unit="px", source="half of an 11 x 11 patch and the search's reach",
        effect="No landmark is looked for nearer to the border. Smaller: patches are cut by it; larger: landmarks "
        "near it are not used.")
    search_cell_px: int = tuned(40, unit="px", source=_SWEEP,
        effect="Landmarks are chosen evenly from squares of this side. Smaller: all of a crowd are looked for; "
        "larger: bare regions are left out.")
    search_enough: float = tuned(250.0, unit="landmarks expected to be found", source=_SWEEP,
        effect="No more are looked for. Smaller: poses tremble and their covariance is too small; larger: it costs "
        "more without gain.")
    search_coarse_limit_px: float = tuned(4.0, unit="px of the half-size image", source=_SWEEP,
        effect="A landmark is not found farther from where it was predicted. Smaller: a poor prediction loses "
        "landmarks; larger: wrong matches pass.")
    search_coarse_score: float = tuned(0.6, unit="correlation", source=_SWEEP,
        effect="A coarse match must correlate at least so well. Smaller: wrong matches cost time; larger: blurred "
        "landmarks are lost.")
    search_fine_limit_px: float = tuned(2.5, unit="px", source=_SWEEP,
        effect="The fine alignment moves a match no further. Smaller: coarse errors are not corrected; larger: wrong "
        "matches pass.")
    search_fine_score: float = tuned(0.75, unit="correlation", source=_SWEEP,
        effect="A fine match must correlate at least so well. Smaller: wrong matches pass; larger: blurred and "
        "slanted landmarks are lost.")
    search_iterations: int = tuned(8, unit="1", source=_SWEEP,
        effect="An alignment makes at most so many steps. Fewer: it ends too early; more: it costs more without "
        "gain.")
    # look_back
    look_back_sigmas: float = tuned(3.0, unit="sigma", source=_BODIES,
        effect="A corner that is off by more has moved. Smaller: good corners are refused; larger: slow bodies "
        "become landmarks.")
    look_back_noise: float = tuned(6.0, unit="grey levels", source=_BODIES,
        effect="The noise of an image in motion, where corners are blurred; otherwise as look_back_sigmas.")
    look_back_px: float = tuned(1.0, unit="px", source=_BODIES,
        effect="The error of the pose and of the rolling shutter; otherwise as look_back_sigmas.")
    look_back_step: float = tuned(0.02, unit="share of the way in the image", source=_BODIES,
        effect="The error of velocities, by which a rolling shutter bends quick turns. Smaller: quick turns look "
        "like motion; larger: slow bodies in quick turns become landmarks.")
    look_back_flow_px: float = tuned(1.0, unit="px", source=_BODIES,
        effect="Sigma of a corner that flow follows; otherwise as look_back_sigmas.")
    look_back_return_px: float = tuned(0.5, unit="px of the half-size image", source=_BODIES,
        effect="A corner that is followed there and back must end this near to where it began. Smaller: bodies are "
        "not found again; larger: corners match by chance.")
    look_back_depth_sigmas: float = tuned(4.0, unit="sigma", source=_BODIES,
        effect="Where depth is off by more, something else was seen; otherwise as look_back_sigmas.")
    look_back_depth_share: float = tuned(0.03, unit="share of the inverse depth", source=_BODIES,
        effect="Added to look_back_depth_sigmas for errors of depth that do not vary; otherwise as look_back_sigmas.")
    # moving_surfaces
    moving_cell_px: int = tuned(32, unit="px", source="a person at 4 m is some 60 px wide",
        effect="Side of a cell. Smaller: it costs more; larger: limbs and people far away are not seen to move.")
    surface_share: float = tuned(0.03, unit="share of the inverse depth", source="as depth_step",
        effect="Neighbouring cells farther from each other's planes belong to different surfaces. Smaller: round "
        "bodies fall apart; larger: feet are one with the floor.")
    moving_cells_least: int = tuned(3, unit="cells", source=_BODIES,
        effect="A surface that moves has at least so many new cells. Fewer: edges of the depth seem to move; more: "
        "people far away do not.")
    moving_surface_share: float = tuned(0.25, unit="share of a surface's cells", source=_BODIES,
        effect="Where a larger share is new, all of the surface moves. Smaller: walls seem to move; larger: wide "
        "bodies that walk slowly do not.")
    # line_of_sight
    sight_step_px: int = tuned(6, unit="px", source="what 0.2 m/s and 1 rad/s move in the 20 ms of a rolling shutter",
        effect="Depth is looked at so far around a landmark's place. Smaller: landmarks at edges of the depth seem "
        "gone; larger: what has left is noticed late.")
    # place_recognition
    place_features: int = tuned(1000, unit="1", source=_SWEEP,
        effect="A place is described by so many. Fewer: places are not recognised; more: it costs more in the "
        "background.")
    place_fast_threshold: int = tuned(5, unit="grey levels", source=_SWEEP,
        effect="A feature needs at least this contrast. Smaller: there are features in noise; larger: there are none "
        "in the dark.")
    place_scale: float = tuned(1.4, unit="ratio of sides",
        source="frames .1 to .5 s apart of fr1_rpy and a head-worn camera; at 1.2 blurred ones do not match",
        effect="Ratio from each of ORB's 8 scales to the next. Smaller: blurred places are not matched; larger: "
        "matches are less exact.")
    place_ratio: float = tuned(0.8, unit="1", source="D. Lowe, IJCV 60, 2004",
        effect="A match must be so much nearer than the second one. Smaller: true matches are dropped; larger: "
        "ambiguous ones are kept.")
    place_most_different: int = tuned(64, unit="bits of 256", source="E. Rublee et al., ICCV 2011, fig. 7",
        effect="Descriptors that differ in more do not match. Smaller: matches over a change of view are lost; "
        "larger: some match by chance.")
    place_candidates: int = tuned(3, unit="places", source=_SWEEP,
        effect="So many are compared in detail. Fewer: the true place is not among them; more: it costs more in the "
        "background.")
    place_candidates_apart: int = tuned(12, unit="places", source="three bodies painted into fr1_rpy, five seeds",
        effect="As place_candidates, of other segments, where most of the view moves. Fewer: segments are not "
        "joined; more: it costs more there.")
    place_least_inliers: int = tuned(25, unit="matches", source=_SWEEP,
        effect="A recognised place needs at least so many. Fewer: look-alike places pass; more: places seen from "
        "elsewhere are not recognised.")
    place_around_px: int = tuned(24, unit="px", source="bodies painted into fr1_rpy, against those painted's own mask",
        effect="Among people a place has only features this near to a landmark that stands. Smaller: few are left; "
        "larger: people are a part of places.")
    place_bucket: int = tuned(24, unit="places", source=_SWEEP,
        effect="For each feature so many count, the newest ones. Fewer: old places are forgotten; more: it costs "
        "more.")
# fmt: on


TUNING = in_use(Tuning)
