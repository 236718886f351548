"""The tuned numbers of mapping (see `geometry.tuning`)."""

from dataclasses import dataclass

from odom.geometry.tuning import in_use, tuned

_SWEEP = "trial on TUM fr1_xyz, fr1_rpy and the arena; swept in odom/docs/sensitivity.md"

_BODIES = "bodies painted into fr1_xyz and fr1_rpy, people in the arena, fr1 as it is"


# fmt: off
@dataclass(frozen=True)
class Tuning:
    """Numbers of the insertion of key frames and of their adjustment."""

    # keyframe_inserter
    coverage_enough: int = tuned(150, unit="landmarks", source=_SWEEP,
        effect="smaller: fewer key frames, poses from fewer landmarks; larger: more key frames, slower")
    coverage_share_landmarks: float = tuned(0.85, unit="share of those at the key frame", source=_SWEEP,
        effect="as coverage_enough, where a key frame itself has few")
    coverage_least: int = tuned(50, unit="landmarks", source=_SWEEP,
        effect="a key frame is due below, however few there were; smaller: LOST in poor scenes; "
        "larger: many key frames")
    coverage_share_cells: float = tuned(0.55, unit="share of those at the key frame", source=_SWEEP,
        effect="smaller: half of the image is empty before a key frame comes; larger: more key frames")
    coverage_cell_px: int = tuned(40, unit="px", source=_SWEEP,
        effect="side of a cell of the image; smaller: cells wear sooner; larger: later")
    least_begun: int = tuned(15, unit="landmarks", source="fewer make no pose: `least_inliers` of tracking",
        effect="fewer: segments begin that nothing can be found by; more: LOST for longer in poor scenes")
    moved_m: float = tuned(0.015, unit="m", source=_SWEEP,
        effect="smaller: key frames at rest; larger: near things are covered late")
    moved_rad: float = tuned(0.02, unit="rad", source=_SWEEP, effect="as moved_m, for rotations")
    timing_settled_s: float = tuned(0.002, unit="s", source="fr1, a HoloLens, a painted room",
        effect="by which an adjustment changes the timing for a key frame to be due as soon as the camera has moved; "
        "smaller: more key frames, slower; larger: in a calm walk in one place the timing stays unknown")
    corners_enough: int = tuned(100, unit="landmarks", source="a HoloLens's walk, in images 540, 320 and 270 px wide",
        effect="with fewer in a key frame, corners are sought in squares half as large; smaller: small images and bare "
        "rooms have few landmarks, and wide steps lose them; larger: corners crowd where a few are as good, slower")
    farthest_m: float = tuned(8.0, unit="m", source="range of a Kinect v1; Khoshelham, Elberink, Sensors 12, 2012",
        effect="smaller: no landmarks in large rooms; larger: depth without information becomes landmarks")
    corners_s: float = tuned(0.02, unit="s", source="between the periods of 60 and 30 Hz; fr1_rpy by an average Kinect",
        effect="after which new corners of a key frame are landmarks; smaller: streams of 60 Hz wait for them; larger: "
        "quick turns at 30 Hz have few landmarks for a frame, and a poor camera errs by 17 % more as published")
    # standing
    recent_apart_s: float = tuned(0.08, unit="s", source=_BODIES,
        effect="between the views kept; smaller: more memory; larger: short glimpses are missed")
    part_px: int = tuned(64, unit="px", source=_BODIES,
        effect="side of a part of the image that moves or stands; smaller: too few corners in one; larger: people and "
        "scene in one")
    part_corners: int = tuned(3, unit="corners", source="most of two is both",
        effect="fewer: single false matches count as motion; more: poor scenes tell nothing")
    parts_least: int = tuned(8, unit="parts", source=_BODIES,
        effect="fewer: a corner of the image speaks for all of it; more: poor scenes tell nothing")
    recent_s: float = tuned(0.6, unit="s", source=_BODIES,
        effect="how far corners are looked back for; smaller: slow bodies become landmarks; larger: fewer were in view")
    recent_turn_rad: float = tuned(0.35, unit="rad", source="half of a Kinect's field of view is .5 x .38",
        effect="by which the camera has turned since; smaller: slow bodies become landmarks in turns; larger: in quick "
        "turns the views hardly overlap, and who comes into view becomes a landmark")
    newest_s: float = tuned(0.25, unit="s", source="fr1_xyz thinned to 2 Hz",
        effect="age of the newest view beyond which none is looked in; smaller: bodies in slow streams become "
        "landmarks; larger: wide steps are LOST")
    spread_least_s: float = tuned(0.06, unit="s", source=_BODIES,
        effect="from which age on a view tells of what else moves; smaller: velocities are noisy; larger: what moves "
        "quickly is not found again")
    recent_views: int = tuned(4, unit="views", source=_BODIES,
        effect="fewer: corners are missed by chance; more: slower key frames")
    moving_views: int = tuned(2, unit="views", source=_BODIES,
        effect="the oldest of them, in which the depth of a whole view is compared; fewer: bodies that come back are "
        "missed; more: slower")
    moving_crowd: float = tuned(0.3, unit="share of the view", source=_BODIES,
        effect="that moves before corners that were never seen before are refused; smaller: the map grows late in "
        "quick turns; larger: who comes into view becomes a landmark")
    long_known_s: float = tuned(0.25, unit="s", source=_BODIES,
        effect="age of landmarks that a key frame needs in doubt; smaller: a body that comes to be followed bears more "
        "of its kind; larger: a camera that turns quickly among people is LOST")
    long_known_least: int = tuned(30, unit="landmarks", source=_BODIES,
        effect="of that age; fewer: as a smaller long_known_s; more: as a larger one")
    young_segment_s: float = tuned(2.0, unit="s", source=_BODIES,
        effect="for which a segment grows without such landmarks; smaller: who begins among people is LOST soon; "
        "larger: a body is followed from the start for longer")
    slow_s: float = tuned(0.1, unit="s", source=_BODIES,
        effect="age at which a view counts half; smaller: bodies that just turn round become landmarks; larger: "
        "views of quick turns count for nothing")
    missed_weight: float = tuned(0.1, unit="share of a moving corner's", source=_BODIES,
        effect="smaller: plain bodies become landmarks; larger: blurred corners are refused")
    moving_least: int = tuned(10, unit="corners", source=_BODIES,
        effect="fewer: chance matches refuse good corners; more: small bodies become landmarks")
    moving_share: float = tuned(0.05, unit="share of the corners seen before", source=_BODIES,
        effect="as moving_least")
    judged_neighbours: int = tuned(8, unit="corners", source=_BODIES,
        effect="fewer: chance decides; more: small bodies are taken for what is around them")
    neighbours_weight: float = tuned(2.0, unit="share of a corner's own", source=_BODIES,
        effect="smaller: chance decides; larger: as judged_neighbours")
    standing_weight: float = tuned(1.0, unit="views that count in full", source=_BODIES,
        effect="of evidence that a corner stands count in full while the pose is in doubt; smaller: bodies that turn "
        "round become landmarks; larger: what comes into view becomes one late")
    standing_least: float = tuned(0.9, unit="of 3: a corner and its neighbours stood in all views", source=_BODIES,
        effect="by which more must say that a corner stands than that it moves, in doubt; smaller: as a smaller "
        "standing_weight; larger: the map grows late where much is blurred or hidden")
    # presence
    gone_s: float = tuned(0.3, unit="s", source=_BODIES,
        effect="a landmark that depth looks through for so long is removed; smaller: landmarks at depth's edges go; "
        "larger: what was carried away is looked for in vain, and found elsewhere")
    gone_step_s: float = tuned(0.1, unit="s", source="three looks at least, as `gone_s`",
        effect="most that one frame counts; smaller: slow streams keep what has left; larger: one bad look counts")
    gone_around: float = tuned(0.15, unit="share of the distance", source="as `departing_within` of tracking",
        effect="within which the neighbours of a removed landmark are looked for; smaller: what lies on a thing that "
        "was carried away stays longer; larger: slower")
    # background
    background_s: float = tuned(0.15, unit="s", source="three times what a task takes",
        effect="after which a result is taken, though fewer frames came; smaller: frames of slow streams wait for it; "
        "larger: slow streams recognise new places late")
    # mapper
    change_frames: int = tuned(10, unit="frames", source="as long as the newest key frames take, or less",
        effect="adjusted by a new lens in the time of one task; fewer: it changes later; more: frames wait for it")
    recalled_at_once: int = tuned(2, unit="key frames", source="some 2 ms each",
        effect="brought back in one frame; fewer: fast walks see landmarks late; more: frames wait for the disk")
    set_aside_ahead: int = tuned(8, unit="key frames", source=".5 ms to look for the farthest of 400",
        effect="chosen at once, to be set aside one by one; fewer: slower; more: by where the camera was long ago")
    # local_adjustment
    adjust_fixed: int = tuned(10, unit="key frames", source=_SWEEP,
        effect="older key frames that hold the newest ones; fewer: drift; more: slower")
    adjust_shared: int = tuned(15, unit="landmarks", source=_SWEEP,
        effect="shared landmarks that make an older key frame hold; fewer: bad ones hold; more: drift")
    adjust_look_back: int = tuned(60, unit="key frames", source=_SWEEP,
        effect="older ones looked at for that; fewer: places come back to are not used; more: slower")
    adjust_iterations: int = tuned(5, unit="1", source=_SWEEP,
        effect="steps of the newest key frames' adjustment; fewer: unfinished; more: slower")
    finish_iterations: int = tuned(15, unit="1", source=_SWEEP,
        effect="steps of the final adjustment; as adjust_iterations")
    # intermediate_frames
    intermediate_s: float = tuned(0.2, unit="s", source="fr1_xyz, fr1_rpy, arena, hololens_part, at 2 to 30 Hz",
        effect="from one to the next; smaller: the final adjustment is slower; larger: frames between key frames gain "
        "less")
    intermediate_most: int = tuned(240, unit="frames", source="memory: 7 MB",
        effect="smaller: long walks gain less; larger: more memory")
    adjusted_most: int = tuned(150, unit="frames", source="memory grows with the square; 10 MB a copy of the system",
        effect="smaller: long walks gain less; larger: slow ends and much memory")
# fmt: on


TUNING = in_use(Tuning)
