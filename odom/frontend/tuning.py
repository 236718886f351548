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
        effect="fewer: more jitter is left in the steady time; more: a clock that drifts is followed late")
    clock_least: int = tuned(6, unit="stamps", source=_KINECT,
        effect="fewer: a line through too little; more: the first frames keep their jitter for longer")
    clock_longest_gap_s: float = tuned(0.5, unit="s", source=_KINECT,
        effect="smaller: the line begins anew after a few lost frames; larger: periods over a gap are miscounted")
    clock_longest_gap_periods: float = tuned(2.5, unit="periods", source="one lost frame and its jitter",
        effect="the same for slow streams; smaller: the line begins anew after a lost frame; larger: as above")
    clock_slowest_s: float = tuned(2.0, unit="s", source="one frame a second, of which one is lost",
        effect="longest period that is learnt; smaller: each frame of a slow stream is taken for one after a gap; "
        "larger: two gaps in a row of a quick stream pass for a period")
    clock_gain: float = tuned(0.2, unit="1", source=_KINECT,
        effect="share of a stamp's error taken over while periods are counted; too small or large: a period is "
        "miscounted")
    clock_most_unsteady: float = tuned(0.25, unit="share of a period", source=_KINECT,
        effect="smaller: jittery clocks are not smoothed; larger: a line is drawn through stamps that have no period")
    clock_most_late_s: float = tuned(0.02, unit="s", source="recordings at 30 Hz that were thinned: 33 ms and more",
        effect="smaller: late stamps of streams below 25 Hz are believed; larger: a frame missing before a slow stream "
        "was thinned out shifts the poses after it")
    clock_outlier: float = tuned(3.0, unit="sigma", source="three sigma of a normal distribution",
        effect="smaller: good stamps are dropped from the line; larger: late ones bend it")
    clock_unknown: float = tuned(0.05, unit="share of a period", source=_KINECT,
        effect="one sigma of a stamp at the start; smaller: too sure of the first seconds; larger: too unsure")
    # noise_monitor
    noise_gain: float = tuned(0.05, unit="1 a frame", source=_SWEEP,
        effect="smaller: noise is learnt late; larger: the covariance trembles with each frame")
    noise_least: int = tuned(15, unit="residuals", source=_SWEEP,
        effect="fewer: medians of too few; more: depth noise far away is never learnt")
    noise_range: float = tuned(8.0, unit="1", source="bounds far beyond any camera met so far",
        effect="how far the noise may go from the prior; smaller: other cameras misjudged; larger: slower to come back")
    noise_unproven: float = tuned(5.0, unit="variance ratio", source=_SWEEP,
        effect="inflation before anything was seen; smaller: too sure at the start; larger: too unsure")
    noise_most: float = tuned(50.0, unit="variance ratio", source=_SWEEP,
        effect="most that one frame's halves may say; smaller: calibration errors underrated; "
        "larger: one bad frame counts long")
    noise_most_jump: float = tuned(100.0, unit="variance ratio", source=_SWEEP,
        effect="most that one jump of poses may say; as above")
    noise_calibration_error: float = tuned(0.025, unit="share of a motion",
        source="default Kinect intrinsics against calibrated",
        effect="error of long motions when calibration is wrong; smaller: too sure of them; "
        "larger: loop closures are taken wrongly")
    noise_explained: float = tuned(3.0, unit="variance ratio", source=_SWEEP,
        effect="inflation that noise alone explains; smaller: calibration blamed too soon; larger: too late")
    tilt_sigma: float = tuned(0.02, unit="rad", source="two cameras are mounted to a degree; fr1's: 1.6 degrees",
        effect="by which the axis of depth is turned against the colour camera's, before anything is seen; smaller: a "
        "tilt is found late; larger: a first glimpse is taken for one")
    tilt_odds: float = tuned(20.0, unit="1", source="strong evidence as R. Kass, A. Raftery 1995 call it",
        effect="Bayes factor from which on depth's axis is taken to be turned; smaller: noise bends walks that hardly "
        "tell a tilt; larger: a tilt is found late")
    tilt_odds_at_once: float = tuned(1e4, unit="1",
        source="between windows of a time-of-flight camera, whose depth errs in rings, and a Kinect's with a tilt",
        effect="the same of a single adjustment's frames, whose errors may be alike; smaller: another fault of depth "
        "is taken for a tilt; larger: a walk's first second is bent by it")
    timing_restart_s: float = tuned(0.001, unit="s", source="assumed of a device that was switched off and on",
        effect="how far a camera's timing may differ from one session to the next; smaller: a changed device is "
        "learnt slowly; larger: it is learnt anew each time")
    timing_memory: float = tuned(0.95, unit="1 an adjustment", source=_SWEEP,
        effect="smaller: shutter and lag stay noisy; larger: changes are followed late")
    # corners
    corner_border_px: int = tuned(14, unit="px", source="radius of a patch (12 px) and 2 px",
        effect="smaller: patches reach beyond the image; "
        "larger: features at the border, which tell rotation best, are lost")
    corner_apart_px: int = tuned(10, unit="px", source=_SWEEP,
        effect="smaller: new corners repeat old ones; larger: gaps are not filled")
    corner_weakest: float = tuned(4e-5, unit="grey^2 of OpenCV's cornerMinEigenVal", source=_SWEEP,
        effect="smaller: corners in noise; larger: poor scenes have too few")
    corner_over_noise: float = tuned(1.2e-5, unit="cornerMinEigenVal of one grey level of noise",
        source="the strongest of an image of white noise, 1.1e-5",
        effect="smaller: corners in noise; larger: faint corners of noisy images are left out")
    # depth_plane
    depth_share_valid: float = tuned(0.5, unit="share of 7 x 7 pixels", source=_SWEEP,
        effect="smaller: planes through too little; larger: depth with holes is not used")
    depth_share_on_surface: float = tuned(0.85, unit="share of measured pixels", source=_SWEEP,
        effect="smaller: mixed pixels at depth edges are used; larger: rough surfaces are not")
    depth_step: float = tuned(0.03, unit="share of the depth", source=_SWEEP,
        effect="smaller: steep surfaces count as edges; larger: edges count as surfaces")
    depth_least_share: float = tuned(0.01, unit="share of the image",
        source="a Kinect close to a wall still shows some per cent",
        effect="smaller: noise counts as depth; larger: a view into the distance counts as blind")
    # images: taken in the dark
    image_contrast: float = tuned(30.0, unit="grey levels (standard deviation)",
        source="below that of every recording in the light (38 to 100); `odom bench robustness --axis darkness`",
        effect="smaller: dark images stay faint; larger: good ones are changed")
    image_clean: float = tuned(3.0, unit="grey levels", source="noise of a Kinect's image, JPEG included",
        effect="noise that needs no smoothing; smaller: detail is smoothed away; larger: landmarks drown in noise")
    image_smooth_px: float = tuned(1.0, unit="px", source="`odom bench robustness --axis darkness`",
        effect="sigma of the smoothing; smaller: noise is left; larger: corners are smoothed away")
    # images: pyramidal Lucas-Kanade
    flow_window_px: int = tuned(15, unit="px", source=_SWEEP,
        effect="smaller: blurred features are lost; larger: slower, and depth edges mix")
    flow_levels: int = tuned(3, unit="pyramid levels", source=_SWEEP,
        effect="fewer: quick turns are lost; more: slower without gain")
    flow_iterations: int = tuned(12, unit="1", source=_SWEEP,
        effect="fewer: coarse pose is rough; more: slower without gain")
    # patches
    patch_least_contrast: float = tuned(5.0, unit="grey^2 (variance)",
        source="noise of a Kinect's image, about 2 grey levels",
        effect="smaller: patches of noise are aligned; larger: dark scenes lose landmarks")
    patch_least_gain: float = tuned(0.2, unit="1", source=_SWEEP,
        effect="smaller: wrong matches of faint texture; larger: exposure changes lose landmarks")
    patch_converged_px: float = tuned(0.02, unit="px", source="a twentieth of the noise",
        effect="smaller: slower; larger: rougher positions")
    warp_step_px: float = tuned(4.0, unit="px", source="a third of a patch's radius",
        effect="step of the numerical derivative of the warp; smaller or larger: hardly anything")
    warp_smallest_area: float = tuned(0.15, unit="ratio of areas", source=_SWEEP,
        effect="smaller: patches are shrunk to a blur; larger: landmarks are lost when the camera backs off")
    warp_largest_area: float = tuned(6.0, unit="ratio of areas", source=_SWEEP,
        effect="smaller: landmarks are lost when the camera comes near; larger: magnified blur is matched")
    # landmark_search
    search_margin_px: float = tuned(8.0, unit="px", source="half of an 11 x 11 patch and the search's reach",
        effect="smaller: patches are cut by the border; larger: landmarks at the border are not used")
    search_cell_px: int = tuned(40, unit="px", source=_SWEEP,
        effect="smaller: crowds of landmarks are all looked for; larger: bare regions are left out")
    search_enough: float = tuned(250.0, unit="landmarks expected to be found", source=_SWEEP,
        effect="no more are looked for; smaller: poses tremble and their covariance is too small; larger: slower "
        "without gain")
    search_coarse_limit_px: float = tuned(4.0, unit="px of the half-size image", source=_SWEEP,
        effect="smaller: a poor prediction loses landmarks; larger: wrong matches")
    search_coarse_score: float = tuned(0.6, unit="correlation", source=_SWEEP,
        effect="smaller: wrong matches cost time; larger: blurred landmarks are lost")
    search_fine_limit_px: float = tuned(2.5, unit="px", source=_SWEEP,
        effect="smaller: coarse errors are not mended; larger: wrong matches")
    search_fine_score: float = tuned(0.75, unit="correlation", source=_SWEEP,
        effect="smaller: wrong matches; larger: blurred and slanted landmarks are lost")
    search_iterations: int = tuned(8, unit="1", source=_SWEEP,
        effect="fewer: alignments end early; more: slower without gain")
    # look_back
    look_back_sigmas: float = tuned(3.0, unit="sigma", source=_BODIES,
        effect="off so far a corner has moved; smaller: good corners are refused; larger: slow bodies become landmarks")
    look_back_noise: float = tuned(6.0, unit="grey levels", source=_BODIES,
        effect="noise of an image in motion: blurred corners are not told apart; as look_back_sigmas")
    look_back_px: float = tuned(1.0, unit="px", source=_BODIES,
        effect="what is not known of the pose and the rolling shutter; as look_back_sigmas")
    look_back_step: float = tuned(0.02, unit="share of the way in the image", source=_BODIES,
        effect="what is not known of the velocities, by which rolling shutters bend quick turns; smaller: quick turns "
        "look like motion; larger: slow bodies in quick turns become landmarks")
    look_back_flow_px: float = tuned(1.0, unit="px", source=_BODIES,
        effect="sigma of a corner followed by flow; as look_back_sigmas")
    look_back_return_px: float = tuned(0.5, unit="px of the half-size image", source=_BODIES,
        effect="followed there and back; smaller: bodies are not found again; larger: chance counts")
    look_back_depth_sigmas: float = tuned(4.0, unit="sigma", source=_BODIES,
        effect="of the depth, off so far something else was seen there; as look_back_sigmas")
    look_back_depth_share: float = tuned(0.03, unit="share of the inverse depth", source=_BODIES,
        effect="added to that: errors of depth that do not vary; as look_back_sigmas")
    # moving_surfaces
    moving_cell_px: int = tuned(32, unit="px", source="a person at 4 m is some 60 px wide",
        effect="side of a cell; smaller: slower; larger: limbs and far people are not seen to move")
    surface_share: float = tuned(0.03, unit="share of the inverse depth", source="as depth_step",
        effect="how far neighbouring cells of one surface may lie off each other's planes; smaller: round bodies fall "
        "apart; larger: feet are one with the floor")
    moving_cells_least: int = tuned(3, unit="cells", source=_BODIES,
        effect="fewer: edges of the depth seem to move; more: far people do not")
    moving_surface_share: float = tuned(0.25, unit="share of a surface's cells", source=_BODIES,
        effect="of a surface must be new for all of it to count as moving; smaller: walls move; larger: wide bodies "
        "that walk slowly do not")
    # line_of_sight
    sight_step_px: int = tuned(6, unit="px", source="what 0.2 m/s and 1 rad/s move in the 20 ms of a rolling shutter",
        effect="how far around a landmark's place depth is looked at; smaller: landmarks at depth's edges seem gone; "
        "larger: what has left is noticed late")
    # place_recognition
    place_features: int = tuned(1000, unit="1", source=_SWEEP,
        effect="fewer: places are not recognised; more: slower in the background")
    place_fast_threshold: int = tuned(5, unit="grey levels", source=_SWEEP,
        effect="smaller: features in noise; larger: none in the dark")
    place_scale: float = tuned(1.4, unit="ratio of sides",
        source="frames .1 to .5 s apart of fr1_rpy and a head-worn camera; at 1.2 blurred ones do not match",
        effect="from each of ORB's 8 scales to the next; smaller: blurred places are not matched; larger: less exact")
    place_ratio: float = tuned(0.8, unit="1", source="D. Lowe, IJCV 60, 2004",
        effect="smaller: true matches are dropped; larger: ambiguous ones are kept")
    place_most_different: int = tuned(64, unit="bits of 256", source="E. Rublee et al., ICCV 2011, fig. 7",
        effect="smaller: matches over a change of view are lost; larger: chance matches")
    place_candidates: int = tuned(3, unit="places", source=_SWEEP,
        effect="fewer: the true place is not among them; more: slower in the background")
    place_candidates_apart: int = tuned(12, unit="places", source="three bodies painted into fr1_rpy, five seeds",
        effect="of other segments, where most of the view moves; fewer: segments are not joined; more: slower there")
    place_least_inliers: int = tuned(25, unit="matches", source=_SWEEP,
        effect="fewer: look-alike places pass; more: places seen from elsewhere are not recognised")
    place_around_px: int = tuned(24, unit="px", source="bodies painted into fr1_rpy, against those painted's own mask",
        effect="from a landmark that stands; smaller: few features are left of a place among people; larger: people "
        "are a part of places")
    place_bucket: int = tuned(24, unit="places", source=_SWEEP,
        effect="newest places that count for each feature; fewer: old ones are forgotten; more: slower")
# fmt: on


TUNING = in_use(Tuning)
