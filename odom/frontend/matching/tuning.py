"""The tuned numbers of matching (see `geometry.tuning`)."""

from dataclasses import dataclass

from odom.geometry.tuning import BODIES, SWEEP, in_use, tuned


# fmt: off
@dataclass(frozen=True)
class Tuning:
    """Numbers of flow, the search of landmarks and the recognition of places."""

    # optical_flow: pyramidal Lucas-Kanade
    flow_window_px: int = tuned(15, unit="px", source=SWEEP,
        effect="Side of the window that flow matches. Smaller: blurred features are lost; larger: it costs more, and "
        "the two sides of a depth edge mix.")
    flow_levels: int = tuned(3, unit="pyramid levels", source=SWEEP,
        effect="Flow begins so many halvings of the image up. Fewer: quick turns are lost; more: it costs more "
        "without gain.")
    flow_iterations: int = tuned(12, unit="1", source=SWEEP,
        effect="Flow makes at most so many steps a level. Fewer: the coarse pose is rough; more: it costs more "
        "without gain.")
    # landmark_search
    search_margin_px: float = tuned(8.0, unit="px", source="half of an 11 x 11 patch and the search's reach",
        effect="No landmark is looked for nearer to the border. Smaller: patches are cut by it; larger: landmarks "
        "near it are not used.")
    search_cell_px: int = tuned(40, unit="px", source=SWEEP,
        effect="Landmarks are chosen evenly from squares of this side. Smaller: all of a crowd are looked for; "
        "larger: bare regions are left out.")
    search_enough: float = tuned(250.0, unit="landmarks expected to be found", source=SWEEP,
        effect="No more are looked for. Smaller: poses tremble and their covariance is too small; larger: it costs "
        "more without gain.")
    search_coarse_limit_px: float = tuned(4.0, unit="px of the half-size image", source=SWEEP,
        effect="A landmark is not found farther from where it was predicted. Smaller: a poor prediction loses "
        "landmarks; larger: wrong matches pass.")
    search_coarse_score: float = tuned(0.6, unit="correlation", source=SWEEP,
        effect="A coarse match must correlate at least so well. Smaller: wrong matches cost time; larger: blurred "
        "landmarks are lost.")
    search_fine_limit_px: float = tuned(2.5, unit="px", source=SWEEP,
        effect="The fine alignment moves a match no further. Smaller: coarse errors are not corrected; larger: wrong "
        "matches pass.")
    search_fine_score: float = tuned(0.75, unit="correlation", source=SWEEP,
        effect="A fine match must correlate at least so well. Smaller: wrong matches pass; larger: blurred and "
        "slanted landmarks are lost.")
    search_iterations: int = tuned(8, unit="1", source=SWEEP,
        effect="An alignment makes at most so many steps. Fewer: it ends too early; more: it costs more without "
        "gain.")
    # look_back
    look_back_sigmas: float = tuned(3.0, unit="sigma", source=BODIES,
        effect="A corner that is off by more has moved. Smaller: good corners are refused; larger: slow bodies "
        "become landmarks.")
    look_back_noise: float = tuned(6.0, unit="grey levels", source=BODIES,
        effect="The noise of an image in motion, where corners are blurred; otherwise as look_back_sigmas.")
    look_back_px: float = tuned(1.0, unit="px", source=BODIES,
        effect="The error of the pose and of the rolling shutter; otherwise as look_back_sigmas.")
    look_back_step: float = tuned(0.02, unit="share of the way in the image", source=BODIES,
        effect="The error of velocities, by which a rolling shutter bends quick turns. Smaller: quick turns look "
        "like motion; larger: slow bodies in quick turns become landmarks.")
    look_back_flow_px: float = tuned(1.0, unit="px", source=BODIES,
        effect="Sigma of a corner that flow follows; otherwise as look_back_sigmas.")
    look_back_return_px: float = tuned(0.5, unit="px of the half-size image", source=BODIES,
        effect="A corner that is followed there and back must end this near to where it began. Smaller: bodies are "
        "not found again; larger: corners match by chance.")
    look_back_depth_sigmas: float = tuned(4.0, unit="sigma", source=BODIES,
        effect="Where depth is off by more, something else was seen; otherwise as look_back_sigmas.")
    look_back_depth_share: float = tuned(0.03, unit="share of the inverse depth", source=BODIES,
        effect="Added to look_back_depth_sigmas for errors of depth that do not vary; otherwise as look_back_sigmas.")
    # moving_surfaces
    moving_cell_px: int = tuned(32, unit="px", source="a person at 4 m is some 60 px wide",
        effect="Side of a cell. Smaller: it costs more; larger: limbs and people far away are not seen to move.")
    surface_share: float = tuned(0.03, unit="share of the inverse depth", source="as depth_step",
        effect="Neighbouring cells farther from each other's planes belong to different surfaces. Smaller: round "
        "bodies fall apart; larger: feet are one with the floor.")
    moving_cells_least: int = tuned(3, unit="cells", source=BODIES,
        effect="A surface that moves has at least so many new cells. Fewer: edges of the depth seem to move; more: "
        "people far away do not.")
    moving_surface_share: float = tuned(0.25, unit="share of a surface's cells", source=BODIES,
        effect="Where a larger share is new, all of the surface moves. Smaller: walls seem to move; larger: wide "
        "bodies that walk slowly do not.")
    # line_of_sight
    sight_step_px: int = tuned(6, unit="px", source="what 0.2 m/s and 1 rad/s move in the 20 ms of a rolling shutter",
        effect="Depth is looked at so far around a landmark's place. Smaller: landmarks at edges of the depth seem "
        "gone; larger: what has left is noticed late.")
    # place_recognition
    place_ratio: float = tuned(0.8, unit="1", source="D. Lowe, IJCV 60, 2004",
        effect="A match must be so much nearer than the second one. Smaller: true matches are dropped; larger: "
        "ambiguous ones are kept.")
    place_most_different: int = tuned(64, unit="bits of 256", source="E. Rublee et al., ICCV 2011, fig. 7",
        effect="Descriptors that differ in more do not match. Smaller: matches over a change of view are lost; "
        "larger: some match by chance.")
    place_candidates: int = tuned(3, unit="places", source=SWEEP,
        effect="So many are compared in detail. Fewer: the true place is not among them; more: it costs more in the "
        "background.")
    place_candidates_apart: int = tuned(12, unit="places", source="three bodies painted into fr1_rpy, five seeds",
        effect="As place_candidates, of other segments, where most of the view moves. Fewer: segments are not "
        "joined; more: it costs more there.")
    place_least_inliers: int = tuned(25, unit="matches", source=SWEEP,
        effect="A recognised place needs at least so many. Fewer: look-alike places pass; more: places seen from "
        "elsewhere are not recognised.")
    place_bucket: int = tuned(24, unit="places", source=SWEEP,
        effect="For each feature so many count, the newest ones. Fewer: old places are forgotten; more: it costs "
        "more.")
    # surface_alignment
    surface_iterations: int = tuned(15, unit="1", source="twice what depth images of fr1 take",
        effect="Surfaces are aligned in at most so many steps. Fewer: quick motions are not followed to their end; "
        "more: it costs more where nothing fits.")
    surface_gate_share: float = tuned(0.1, unit="share of the inverse depth", source="10 cm at a metre, 3 m/s at 30 Hz",
        effect="A point this far from a plane may still lie on it, before the first step. Smaller: quick motions are "
        "not followed; larger: surfaces are mixed up.")
    surface_gate_shrinks: float = tuned(0.6, unit="1", source="as surface_iterations",
        effect="The gate of each step is so much smaller than the one before. Smaller: it closes before the surfaces "
        "are aligned; larger: other surfaces count for longer.")
    surface_least_gate_share: float = tuned(0.01, unit="share of the inverse depth", source="1 cm at a metre",
        effect="The gate of the last steps. Smaller: a poor lens leaves no points; larger: what moves counts.")
    surface_gate_sigmas: float = tuned(3.0, unit="sigma", source="normal distribution, 99.7 %",
        effect="The noise's part of the gate. Smaller: good points are left out; larger: as surface_least_gate_share.")
    surface_huber_sigmas: float = tuned(1.5, unit="sigma", source="P. Huber, 1964",
        effect="Points farther off count less. Smaller: noise is not averaged as well; larger: what moves pulls more.")
    surface_least_shape: float = tuned(0.003, unit="mean squared share of a step",
        source="the arena's walls at .002 let the camera slide by a metre",
        effect="In directions in which surfaces have less shape they say nothing. Smaller: noise moves the camera "
        "along walls; larger: it is LOST where shapes would tell.")
    surface_shared_noise: float = tuned(1000.0, unit="1", source="fr1 and arena against their trajectories",
        effect="The variance of a motion found by surfaces is so much larger than independent noise would make it. "
        "Smaller: it is believed too much; larger: too little.")
# fmt: on


TUNING = in_use(Tuning)
