"""The tuned numbers of mapping (see `geometry.tuning`)."""

from dataclasses import dataclass

from odom.geometry.tuning import BODIES, SWEEP, in_use, tuned


# fmt: off
@dataclass(frozen=True)
class Tuning:
    """Numbers of the insertion of key frames and of their adjustment."""

    # keyframe_inserter
    coverage_enough: int = tuned(150, unit="landmarks", source=SWEEP,
        effect="A key frame is due where fewer are found. Smaller: there are fewer key frames, and poses from fewer "
        "landmarks; larger: more key frames, which cost more.")
    coverage_share_landmarks: float = tuned(0.85, unit="share of those at the key frame", source=SWEEP,
        effect="As coverage_enough, where a key frame itself has few: one is due where a smaller share of its "
        "landmarks is found.")
    coverage_least: int = tuned(50, unit="landmarks", source=SWEEP,
        effect="A key frame is due where fewer are found, however few there were. Smaller: the camera is LOST in poor "
        "scenes; larger: there are many key frames.")
    coverage_share_cells: float = tuned(0.55, unit="share of those at the key frame", source=SWEEP,
        effect="A key frame is due where landmarks cover a smaller share of the image's cells. Smaller: half of the "
        "image is empty before one comes; larger: there are more key frames.")
    coverage_cell_px: int = tuned(40, unit="px", source=SWEEP,
        effect="The side of a cell of the image. Smaller: cells are empty sooner; larger: later.")
    least_begun: int = tuned(15, unit="landmarks", source="fewer make no pose: `least_inliers` of tracking",
        effect="A segment begins with at least so many. Fewer: segments begin by which nothing can be found; more: the "
        "camera is LOST for longer in poor scenes.")
    moved_m: float = tuned(0.015, unit="m", source=SWEEP,
        effect="A key frame is due only if the camera has moved so far. Smaller: there are key frames at rest; larger: "
        "near things are covered late.")
    moved_rad: float = tuned(0.02, unit="rad", source=SWEEP,
        effect="As moved_m, for rotations.")
    timing_settled_s: float = tuned(0.002, unit="s", source="fr1, a HoloLens, a painted room",
        effect="While adjustments change the timing by more, a key frame is due as soon as the camera has moved. "
        "Smaller: more key frames, which cost more; larger: in a calm walk in one place the timing stays unknown.")
    alone_s: float = tuned(1.0, unit="s", source="a painted room in 640 x 480; fr1 has its second key frame by then",
        effect="After so long a segment's first key frame is followed by another as soon as the camera has moved. "
        "Smaller: the first adjustment knows too short a motion; larger: in a calm walk in one place the timing stays "
        "unknown.")
    corners_enough: int = tuned(100, unit="landmarks", source="a HoloLens's walk, in images 540, 320 and 270 px wide",
        effect="Where a key frame has fewer, corners are sought in squares half as large. Smaller: small images and "
        "bare rooms have few landmarks, and wide steps lose them; larger: corners crowd where a few are as good.")
    farthest_m: float = tuned(8.0, unit="m", source="range of a Kinect v1; Khoshelham, Elberink, Sensors 12, 2012",
        effect="No landmark is made beyond this depth. Smaller: large rooms have none; larger: depth without "
        "information becomes landmarks.")
    corners_s: float = tuned(0.02, unit="s", source="between the periods of 60 and 30 Hz; fr1_rpy by an average Kinect",
        effect="After so long new corners of a key frame become landmarks. Smaller: streams of 60 Hz wait for them; "
        "larger: quick turns at 30 Hz have few landmarks for a frame, and a poor camera errs by 17 % more as "
        "published.")
    # standing
    recent_apart_s: float = tuned(0.08, unit="s", source=BODIES,
        effect="The views that are kept lie so far apart in time. Smaller: more memory; larger: short glimpses are "
        "missed.")
    part_px: int = tuned(64, unit="px", source=BODIES,
        effect="The side of a part of the image that moves or stands. Smaller: it holds too few corners; larger: it "
        "holds people and scene.")
    part_corners: int = tuned(3, unit="corners", source="most of two is both",
        effect="A part is judged from so many. Fewer: single false matches count as motion; more: poor scenes tell "
        "nothing.")
    parts_least: int = tuned(8, unit="parts", source=BODIES,
        effect="The view is judged from so many. Fewer: one corner of the image speaks for all of it; more: poor "
        "scenes tell nothing.")
    recent_s: float = tuned(0.6, unit="s", source=BODIES,
        effect="Corners are looked for in views up to this age. Smaller: slow bodies become landmarks; larger: fewer "
        "corners were in view then.")
    recent_turn_rad: float = tuned(0.35, unit="rad", source="half of a Kinect's field of view is .5 x .38",
        effect="Views from which the camera has turned further are left out. Smaller: slow bodies become landmarks in "
        "turns; larger: in quick turns the views hardly overlap, and who comes into view becomes a landmark.")
    spread_least_s: float = tuned(0.06, unit="s", source=BODIES,
        effect="From this age on a view tells of what else moves. Smaller: velocities are noisy; larger: what moves "
        "quickly is not found again.")
    spread_most_s: float = tuned(0.6, unit="s", source="bodies painted into fr1_rpy thinned to 4 Hz",
        effect="Nor in one of longer ago. Smaller: in slow streams bodies are followed and called sure; larger: few "
        "corners are followed so far.")
    recent_views: int = tuned(4, unit="views", source=BODIES,
        effect="Corners are looked for in so many. Fewer: they are missed by chance; more: key frames cost more.")
    moving_views: int = tuned(2, unit="views", source=BODIES,
        effect="In so many, the oldest ones, the depth of the whole view is compared. Fewer: bodies that come back are "
        "missed; more: it costs more.")
    moving_crowd: float = tuned(0.3, unit="share of the view", source=BODIES,
        effect="Where a larger share moves, corners that no earlier view saw are refused. Smaller: the map grows late "
        "in quick turns; larger: who comes into view becomes a landmark.")
    long_known_s: float = tuned(0.25, unit="s", source=BODIES,
        effect="In doubt, a key frame needs landmarks of this age. Smaller: a body that comes to be followed gives "
        "more of its own; larger: a camera that turns quickly among people is LOST.")
    long_known_least: int = tuned(30, unit="landmarks", source=BODIES,
        effect="In doubt, a key frame needs so many landmarks of that age. Fewer: as a smaller long_known_s; more: as "
        "a larger one.")
    young_segment_s: float = tuned(2.0, unit="s", source=BODIES,
        effect="For so long a segment grows without such landmarks. Smaller: a camera that begins among people is LOST "
        "soon; larger: a body is followed from the start for longer.")
    slow_s: float = tuned(0.1, unit="s", source=BODIES,
        effect="A view of this age counts half. Smaller: bodies that just turn round become landmarks; larger: views "
        "of quick turns count for nothing.")
    missed_weight: float = tuned(0.1, unit="share of a moving corner's", source=BODIES,
        effect="A corner that is not found again counts this much of one that moved. Smaller: plain bodies become "
        "landmarks; larger: blurred corners are refused.")
    moving_least: int = tuned(10, unit="corners", source=BODIES,
        effect="Corners are refused only where at least so many move. Fewer: good ones are refused by chance matches; "
        "more: small bodies become landmarks.")
    moving_share: float = tuned(0.05, unit="share of the corners seen before", source=BODIES,
        effect="The share that must move at least, as moving_least.")
    judged_neighbours: int = tuned(8, unit="corners", source=BODIES,
        effect="A corner is judged together with so many. Fewer: chance decides; more: small bodies are taken for what "
        "is around them.")
    neighbours_weight: float = tuned(2.0, unit="share of a corner's own", source=BODIES,
        effect="The weight of the neighbours in that. Smaller: chance decides; larger: as judged_neighbours.")
    standing_weight: float = tuned(1.0, unit="views that count in full", source=BODIES,
        effect="In doubt, evidence that a corner stands counts in full from so many views on. Smaller: bodies that "
        "turn round become landmarks; larger: what comes into view becomes one late.")
    standing_least: float = tuned(0.9, unit="of 3: a corner and its neighbours stood in all views", source=BODIES,
        effect="In doubt, the evidence that a corner stands must exceed that it moves by this. Smaller: as a smaller "
        "standing_weight; larger: the map grows late where much is blurred or hidden.")
    # presence
    gone_s: float = tuned(0.3, unit="s", source=BODIES,
        effect="A landmark that depth looks through for so long is removed. Smaller: so are landmarks at the edges of "
        "depth; larger: what was carried away is looked for in vain, and found elsewhere.")
    gone_step_s: float = tuned(0.1, unit="s", source="three looks at least, as `gone_s`",
        effect="One frame counts for so long at most. Smaller: slow streams keep what has left; larger: one wrong look "
        "counts.")
    # depth_filter
    parallax_variance: float = tuned(9.0, unit="variances of a ray",
        source="six walks of the arena, depth cut off at 1.9 and 2.1 m; 4 to 25",
        effect="What a frame's ray tells of a landmark's depth counts as if it were so much less certain, since frames "
        "share errors. Smaller: depths seem surer than they are; larger: landmarks are found late.")
    # background
    background_s: float = tuned(0.15, unit="s", source="three times what a task takes",
        effect="After so long a result of the background is taken although fewer frames came than it may wait. "
        "Smaller: frames of slow streams wait for it; larger: slow streams recognise new places late.")
    # mapper
    change_frames: int = tuned(10, unit="frames", source="as long as the newest key frames take, or less",
        effect="So many are converted to a new lens in the time of one task. Fewer: the lens changes later; more: "
        "frames wait for it.")
    recalled_at_once: int = tuned(2, unit="key frames", source="some 2 ms each",
        effect="So many are brought back from a saved map in one frame. Fewer: fast walks see their landmarks late; "
        "more: frames wait for the disk.")
    set_aside_ahead: int = tuned(8, unit="key frames", source=".5 ms to look for the farthest of 400",
        effect="So many are chosen at once, to be set aside one by one. Fewer: choosing costs more; more: they are "
        "chosen by where the camera was long ago.")
    # map_adjustment
    adjust_fixed: int = tuned(10, unit="key frames", source=SWEEP,
        effect="So many older ones hold the newest ones in place. Fewer: the map drifts; more: adjustments cost more.")
    adjust_shared: int = tuned(15, unit="landmarks", source=SWEEP,
        effect="A frame is adjusted, and an older one holds others, if it shares so many. Fewer: badly connected ones "
        "run away; more: the map drifts.")
    adjust_look_back: int = tuned(60, unit="key frames", source=SWEEP,
        effect="So many older ones are examined for that. Fewer: places to which the camera comes back are not used; "
        "more: it costs more.")
    adjust_iterations: int = tuned(5, unit="1", source=SWEEP,
        effect="Steps of the adjustment of the newest key frames. Fewer: it is not finished; more: it costs more.")
    finish_iterations: int = tuned(15, unit="1", source=SWEEP,
        effect="Steps of the final adjustment, as adjust_iterations.")
    # row_motion
    motion_window_s: float = tuned(0.04, unit="s", source="turn rates of fr1's truth, readouts of the arena",
        effect="Velocities are read from the trajectory over this time before and after. Smaller: they are noisier; "
        "larger: a trembling hand's are too small, those of fr1_xyz by 6 % at .04 and 12 % at .07.")
    motion_reach_s: float = tuned(0.07, unit="s", source="two periods of 30 Hz",
        effect="Frames farther apart than that say nothing of a velocity. Smaller: slow cameras have none; "
        "larger: what turned meanwhile is missed.")
    misjudged_readout_s: float = tuned(0.002, unit="s", source="ten walks of the arena, also turned by 180 degrees",
        effect="Frames measured by a readout that was farther off are carried anew at the end. Smaller: frames that "
        "were carried well by their own rows lose by it; larger: the first seconds of other shutters stay bent.")
    # shutter_kind
    readout_in_doubt: float = tuned(0.1, unit="share of the readout", source="the default is .3, of a known device .05",
        effect="Other kinds of shutters are tried where one sigma of the expected readout is larger. Smaller: also "
        "where it was said; larger: never.")
    shutter_believed_chi2: float = tuned(30.0, unit="1", source="ten parts of fr1, four of the arena, both ways up",
        effect="Another kind is believed that explains the first key frames so much better. Smaller: noise decides; "
        "larger: more frames are measured by a wrong one.")
    shutter_refuted_chi2: float = tuned(100.0, unit="1", source="ten parts of fr1, four of the arena, both ways up",
        effect="A kind that explains them so much worse is not tried again. Smaller: noise decides; larger: trials "
        "cost more.")
    # intermediate_frames
    intermediate_s: float = tuned(0.2, unit="s", source="fr1_xyz, fr1_rpy, arena, hololens_part, at 2 to 30 Hz",
        effect="The time from one kept frame to the next. Smaller: the final adjustment costs more; larger: frames "
        "between key frames gain less.")
    intermediate_most: int = tuned(240, unit="frames", source="memory: 7 MB",
        effect="So many are kept. Fewer: long walks gain less; more: memory.")
    adjusted_most: int = tuned(150, unit="frames", source="memory grows with the square; 10 MB a copy of the system",
        effect="So many are adjusted at the end, key frames included. Fewer: long walks gain less; more: the end takes "
        "longer, and much memory.")
# fmt: on


TUNING = in_use(Tuning)
