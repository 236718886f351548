"""The tuned numbers of the odometry (see `geometry.tuning`)."""

from dataclasses import dataclass

from odom.geometry.tuning import BODIES, SWEEP, in_use, tuned


# fmt: off
@dataclass(frozen=True)
class Tuning:
    """Numbers of frames in order: gaps, losses, and what is published."""

    longest_gap_s: float = tuned(0.2, unit="s", source=SWEEP,
        effect="Over a longer gap between frames the camera is not followed, nor its motion interpolated. Smaller: it "
        "is LOST after two lost frames; larger: wrong motions are taken.")
    longest_gap_periods: float = tuned(2.5, unit="periods", source=SWEEP,
        effect="As longest_gap_s, in a slow stream: so many periods count where they are longer.")
    longest_blind_periods: float = tuned(1.5, unit="periods", source="one lost depth image",
        effect="After a longer time without depth, a frame that cannot be followed is LOST at once. Smaller: so is one "
        "behind a single lost depth image; larger: known places are looked for in vain.")
    least_corners: int = tuned(50, unit="features with depth", source=SWEEP,
        effect="A segment begins at a view that shows at least so many, or is full of corners. Fewer: it begins at a "
        "bare wall; more: the camera is LOST for longer in poor scenes.")
    least_deep: float = tuned(0.05, unit="share of landmarks", source=SWEEP,
        effect="A frame lacks depth where a smaller share of its landmarks has some. Smaller: a frame with hardly any "
        "counts as one with depth; larger: far scenes count as without.")
    longest_shallow_s: float = tuned(0.15, unit="s", source="four frames at 30 Hz",
        effect="After a longer time without depth at the landmarks a pose by few of them is UNCERTAIN. Smaller: after "
        "two frames; larger: it is called sure by landmarks of the map alone.")
    new_time_s: float = tuned(1.0, unit="s", source="no stream delays frames by so much",
        effect="Stamps that step back further begin a new time. Smaller: a late frame begins one; larger: a recording "
        "that is played in a loop is refused.")
    cut_chi2: float = tuned(100.0, unit="chi-squared", source="at most 67 in freiburg1_rpy, 100 to 1360 at cuts",
        effect="A pose so far from the predicted one begins the motion anew. Smaller: a jerk does; larger: behind a "
        "cut in a recording the camera seems to fly for a second.")
    moving_period_s: float = tuned(0.1, unit="s", source="a person moves by half a limb's width",
        effect="What moves is looked at so often. Smaller: it costs more; larger: it is noticed late.")
    moving_most: float = tuned(0.5, unit="share of the view", source="most of it",
        effect="Where a larger share moves, the pose is UNCERTAIN. Smaller: sure poses are called unsure; larger: the "
        "camera is taken along unnoticed.")
    moving_little: float = tuned(0.2, unit="share of the view", source=BODIES,
        effect="Soon after the start (moving_young_s) a larger share that moves leaves the pose in doubt. Smaller: it "
        "is UNCERTAIN for longer; larger: wrong poses count as sure.")
    moving_young_s: float = tuned(2.0, unit="s", source=BODIES,
        effect="For so long after the first look moving_little counts. Smaller: a crowd before the camera at its start "
        "is followed and called sure; larger: a person who comes early leaves sure poses in doubt.")
    moving_seen: float = tuned(0.15, unit="share of the view", source="0 at rest, .1 with late depth; " + BODIES,
        effect="Where a larger share moved within moving_calm_s, surfaces do not lead the camera in the dark. Smaller: "
        "it is LOST for late or noisy depth; larger: surfaces of a body lead it.")
    moving_calm_s: float = tuned(1.5, unit="s", source=BODIES,
        effect="For so long no more than moving_most may move before the pose is sure again. Smaller: a body that "
        "fills the view counts as the scene; larger: the pose is UNCERTAIN for longer.")
    moved_parts: float = tuned(0.4, unit="share of the view", source=BODIES,
        effect="Where the corners of a key frame moved in a larger share, the pose is UNCERTAIN. Smaller: quick turns "
        "are called unsure; larger: a body that is followed is not noticed.")
    moved_parts_s: float = tuned(5.0, unit="s", source=BODIES,
        effect="The doubt of moved_parts lasts so long, unless landmarks from before agree. Smaller: a body that is "
        "followed counts as the scene between two key frames; larger: the pose is UNCERTAIN for longer.")
    moved_support: float = tuned(2.0, unit="landmarks from before found for each one missed", source=BODIES,
        effect="So many end the doubt of moved_parts sooner. Smaller: as a smaller moved_parts_s; larger: as a larger "
        "one.")
    moved_contradicts: float = tuned(3.0, unit="landmarks from before missed for each one found", source=BODIES,
        effect="From so many on, they deny the pose soon after a doubt (denied_looks). Smaller: it is UNCERTAIN in "
        "quick turns; larger: a body that has just come is followed and called sure.")
    moved_as_one: float = tuned(0.1, unit="share of the votes", source="torn, blurred, ill exposed images; " + BODIES,
        effect="Another motion counts from this share on. Smaller: one that is found by chance counts; larger: a small "
        "body is not noticed.")
    moved_rival: float = tuned(0.4, unit="share of the votes", source=BODIES,
        effect="Another motion with more, in two looks within moved_as_one_s, puts the pose in doubt where no "
        "landmarks tell. Smaller: who walks by leaves sure poses in doubt; larger: a body that fills the view from "
        "the start is followed and called sure.")
    moved_behind: float = tuned(0.25, unit="share of the votes", source=BODIES,
        effect="As moved_rival, for a motion of what lies behind what moves with the camera.")
    moved_as_one_s: float = tuned(1.0, unit="s", source="as moved_as_one",
        effect="Another motion that was seen counts for so long. Smaller: the pose is sure between two looks that show "
        "the body; larger: it is UNCERTAIN for longer.")
    confirmed_looks: int = tuned(5, unit="looks", source=BODIES,
        effect="After so many looks that showed that the camera follows the scene, and none since that it does not, "
        "its landmarks can tell as well. Fewer: a body is followed and called sure; more: the pose is UNCERTAIN for "
        "longer.")
    moved_denies: float = tuned(10.0, unit="landmarks from before missed for each one found", source=BODIES,
        effect="From so many on, one look counts as denied_looks. Smaller: the pose is UNCERTAIN in quick turns; "
        "larger: a body that comes in one gives landmarks before it is noticed.")
    denied_looks: int = tuned(2, unit="looks", source=BODIES,
        effect="So many in a row, in which landmarks that can tell contradict the pose soon after a doubt, put it in "
        "doubt again. Fewer: it is UNCERTAIN in quick turns; more: a body that has just come is followed and called "
        "sure.")
    spread_newest: float = tuned(0.3, unit="1", source=BODIES,
        effect="The weight of the newest look in how unsure the camera's velocity is. Smaller: bodies that stop are "
        "doubted for longer; larger: a single look that does not tell the body from the scene makes the motion too "
        "sure.")
    mask_most: float = tuned(0.95, unit="share of the image", source="nothing is left to track by",
        effect="A segmenter's mask that covers more is ignored. Smaller: so are right ones; larger: a wrong one makes "
        "the camera LOST.")
    mask_reasons: int = tuned(16, unit="1", source="more than there are kinds of wrong masks",
        effect="So many different errors of a segmenter are counted by themselves. Fewer: causes are mixed up; more: "
        "memory, where its errors differ each time.")
    calibrate_least: int = tuned(16, unit="frames", source="twelve starts of fr1: 12 and 24 are worse",
        effect="A calibrator looks first after so many key frames and frames between. Fewer: they show too little; "
        "more: a poor calibration is used for longer.")
    calibrate_most: int = tuned(200, unit="frames", source="a map of so many is adjusted anew in 2 s",
        effect="A calibrator does not look any more after so many. Fewer: a walk that shows little keeps a poor "
        "camera; more: frames wait for the map.")
    calibrate_frames: int = tuned(15, unit="frames", source="twice what it takes at 30 Hz",
        effect="A calibrator has so many for its first look, in the background, and more in proportion for later ones. "
        "Fewer: the stream waits for it, and live frames are lost; more: the better camera comes later.")
    calibrate_s: float = tuned(0.5, unit="s", source="as calibrate_frames",
        effect="As calibrate_frames, in a slow stream.")
    taken_back: float = tuned(0.015, unit="share of a motion", source="half of what a poor lens errs by on fr1",
        effect="A better lens takes back what a poor one had displaced by this share of the camera's motion. Smaller: "
        "poses are displaced for longer; larger: steps are less exact meanwhile, as by the poor lens.")
    patience: float = tuned(5.0, unit="times the time after which a segment begins", source=BODIES,
        effect="Where most of the view moved, a camera that is LOST looks for known places so much longer. Smaller: "
        "segments begin on bodies; larger: it is LOST for longer.")
    patience_with_scene: float = tuned(0.25, unit="times the time after which a segment begins", source=BODIES,
        effect="As patience, where lost views show the scene by themselves. Smaller: segments begin that soon would "
        "have been found again; larger: the camera is LOST for longer.")
    recent: int = tuned(256, unit="frames", source="a second at 240 Hz",
        effect="Among so many the frame of a second ago is searched. Fewer: there is none at high rates; more: memory.")
    near_a_second_s: float = tuned(0.075, unit="s", source="two periods at 30 Hz, rounded up",
        effect="The motion over a second may be off from a second by so much. Smaller: there is none after a lost "
        "frame; larger: the second is inexact.")
    surface_acceleration_m_s2: float = tuned(4.0, unit="m/s^2", source="fr1 and arena, 2 s without colour",
        effect="The acceleration of a camera that is followed by surfaces, a root mean square. Smaller: it is not "
        "followed in quick turns; larger: it slides along surfaces with little shape.")
    surface_acceleration_rad_s2: float = tuned(24.0, unit="rad/s^2", source="as surface_acceleration_m_s2",
        effect="as surface_acceleration_m_s2")
    surface_least_overlap: float = tuned(0.3, unit="share of points", source="as surface_enough_overlap",
        effect="A view of which fewer points lie on the surfaces of an earlier one is not aligned with it. Smaller: "
        "other surfaces are taken for them; larger: the camera is LOST behind a body that hides them.")
    surface_most_misfit: float = tuned(2.0, unit="times the best so far", source="as surface_least_overlap; " + BODIES,
        effect="Surfaces that are further apart, in sigmas and of noise at least, do not lead the camera. Smaller: it "
        "is LOST where the calibration is off; larger: surfaces of a body, or of noise, lead it.")
    surface_most_in_front: float = tuned(0.05, unit="share of points", source="as surface_most_misfit",
        effect="More points before the surfaces of an earlier view are those of a body that has come. Smaller: noisy "
        "depth does not lead the camera; larger: bodies lead it.")
    surface_enough_overlap: float = tuned(0.6, unit="share of points", source="fr1 and arena, 2 s without colour",
        effect="With fewer, later views are aligned with this one. Smaller: with what little is left of an old view; "
        "larger: the errors of more alignments add up.")
    repeated_px: float = tuned(0.5, unit="px", source="hands that hold a camera still move it by .2 to .5 px a frame",
        effect="The same image again is no standstill where the camera should have moved it further. Smaller: a drawn "
        "camera that comes to rest seems to repeat its image; larger: slow motion stands still in every second frame.")
    repeated_share: float = tuned(0.7, unit="share of pixels, and of those at edges", source="at edges in fr1 and a "
        "HoloLens .06 at most, .02 in the median; a codec that changes a tenth of the pixels leaves .8",
        effect="An image of which more is equal is the last one again. Smaller: slow motion seems to repeat an image; "
        "larger: a repetition that a codec or a clock in the image has changed is taken for a standstill.")
    repeated_contrast: int = tuned(4, unit="grey levels", source="above the noise of a Kinect",
        effect="Pixels that differ more from their neighbour in the row are at edges. Smaller: flat areas count, which "
        "are equal in any two images; larger: images without contrast are compared whole.")
    repeated_rows: int = tuned(13, unit="rows", source="cost: 30 us a frame; no divisor of drawn patterns",
        effect="One of so many rows is compared. Fewer rows: a clock in the image fills more of them; more: time.")
    # smoothing
    noise_share: float = tuned(0.5, unit="share of the claimed variance", source="fr1, arena, 2 to 30 Hz",
        effect="No more can be noise from frame to frame. Smaller: quick turns at 4 Hz tremble; larger: the steps of "
        "somebody who walks are smoothed away at that rate.")
    steady_share: float = tuned(0.2, unit="share of a period", source=SWEEP,
        effect="A step off by less counts as one period long. Smaller: jumps in jittery streams are not seen; larger: "
        "gaps count as jumps.")
# fmt: on


TUNING = in_use(Tuning)
