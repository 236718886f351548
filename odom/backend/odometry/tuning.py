"""The tuned numbers of the odometry (see `geometry.tuning`)."""

from dataclasses import dataclass

from odom.geometry.tuning import in_use, tuned

_SWEEP = "trial on TUM fr1_xyz, fr1_rpy and the arena; swept in odom/docs/sensitivity.md"

_BODIES = "bodies painted into fr1_xyz and fr1_rpy, people in the arena, fr1 as it is"


# fmt: off
@dataclass(frozen=True)
class Tuning:
    """Numbers of frames in order: gaps, losses, and what is published."""

    longest_gap_s: float = tuned(0.2, unit="s", source=_SWEEP,
        effect="longest gap over which the camera is followed; smaller: LOST after two lost frames; "
        "larger: wrong motions")
    longest_gap_periods: float = tuned(2.5, unit="periods", source=_SWEEP, effect="the same for slow streams")
    longest_blind_periods: float = tuned(1.5, unit="periods", source="one lost depth image",
        effect="smaller: one lost depth image is LOST; larger: frames without depth are searched in vain")
    least_corners: int = tuned(50, unit="features with depth", source=_SWEEP,
        effect="fewer: segments begin at bare walls; more: LOST for longer in poor scenes")
    least_deep: float = tuned(0.05, unit="share of landmarks", source=_SWEEP,
        effect="smaller: a frame hardly any depth is taken for one with; larger: far scenes count as without depth")
    longest_shallow_s: float = tuned(0.15, unit="s", source="four frames at 30 Hz",
        effect="smaller: UNCERTAIN after two frames without depth; larger: TRACKING on landmarks alone")
    new_time_s: float = tuned(1.0, unit="s", source="no stream delays frames by so much",
        effect="a step of the stamps so far back is a new time; smaller: late frames begin one; "
        "larger: loops are refused")
    moving_period_s: float = tuned(0.1, unit="s", source="a person moves by half a limb's width",
        effect="smaller: slower; larger: what moves is shown late")
    moving_most: float = tuned(0.5, unit="share of the view", source="most of it",
        effect="that moves before the pose is UNCERTAIN; smaller: sure poses are called unsure; larger: the camera is "
        "taken along unnoticed")
    moving_little: float = tuned(0.2, unit="share of the view", source=_BODIES,
        effect="that may move in the first moving_young_s for the pose to be sure; smaller: UNCERTAIN for longer; "
        "larger: wrong poses count as sure")
    moving_young_s: float = tuned(2.0, unit="s", source=_BODIES,
        effect="after the first look in which moving_little counts; smaller: a crowd before the camera at its start is "
        "followed and called sure; larger: a person who comes early leaves sure poses in doubt")
    moving_calm_s: float = tuned(1.5, unit="s", source=_BODIES,
        effect="in which no more than moving_most moves before the pose is sure again; smaller: a body that fills "
        "the view counts as the scene; larger: UNCERTAIN for longer")
    moved_parts: float = tuned(0.4, unit="share of the view", source=_BODIES,
        effect="in which the corners of a key frame moved, before the pose is UNCERTAIN; smaller: quick turns are "
        "called unsure; larger: a body that is followed is not noticed")
    moved_parts_s: float = tuned(5.0, unit="s", source=_BODIES,
        effect="for which that holds, unless landmarks from before agree; smaller: a body that is followed counts as "
        "the scene between two key frames; larger: UNCERTAIN for longer")
    moved_support: float = tuned(2.0, unit="landmarks from before found for each one missed", source=_BODIES,
        effect="that end this doubt sooner; smaller: as a smaller moved_parts_s; larger: as a larger one")
    moved_contradicts: float = tuned(3.0, unit="landmarks from before missed for each one found", source=_BODIES,
        effect="before it is looked for what else moves; smaller: slower in quick turns; larger: a body that comes to "
        "be followed in a quick turn is not noticed")
    moved_as_one: float = tuned(0.1, unit="share of the votes", source="torn, blurred, ill exposed images; " + _BODIES,
        effect="that another motion must have for corners that do not stand to count; smaller: chance counts; larger: "
        "a small body is not noticed")
    moved_rival: float = tuned(0.4, unit="share of the votes", source=_BODIES,
        effect="that another motion must have in two looks of moved_as_one_s for a pose to be in doubt before any view "
        "was calm; smaller: who walks by leaves sure poses in doubt; larger: a body that fills the view from the "
        "start is followed and called sure")
    moved_as_one_s: float = tuned(1.0, unit="s", source="as moved_as_one",
        effect="for which another motion that was seen counts; smaller: sure between two looks that show the body; "
        "larger: UNCERTAIN for longer")
    confirmed_looks: int = tuned(5, unit="looks", source=_BODIES,
        effect="that must show that the camera follows the scene, none of them since that it does not, for its "
        "landmarks to tell, too; fewer: a body is followed and called sure; more: UNCERTAIN for longer")
    moved_denies: float = tuned(10.0, unit="landmarks from before missed for each one found", source=_BODIES,
        effect="for which one look counts as denied_looks; smaller: UNCERTAIN in quick turns; larger: a body that "
        "comes in one gives landmarks before it is noticed")
    denied_looks: int = tuned(2, unit="looks", source=_BODIES,
        effect="in a row in which landmarks that tell contradict the pose, for it to be in doubt again soon after a "
        "doubt; fewer: UNCERTAIN in quick turns; more: a body that has just come is followed and called sure")
    spread_newest: float = tuned(0.3, unit="1", source=_BODIES,
        effect="weight of the newest look in how unsure the velocity is; smaller: bodies that stop are doubted for "
        "longer; larger: a single look in which the body is not told from the scene makes the step too sure")
    mask_most: float = tuned(0.95, unit="share of the image", source="nothing is left to track by",
        effect="masked beyond which a segmenter's mask is ignored; smaller: true ones are; larger: LOST by a wrong one")
    mask_reasons: int = tuned(16, unit="1", source="more than there are kinds of wrong masks",
        effect="fewer: causes are mixed up; more: memory, where a segmenter's errors differ each time")
    calibrate_least: int = tuned(16, unit="frames", source="twelve starts of fr1: 12 and 24 are worse",
        effect="key frames and frames between that a calibrator first looks at; fewer: they show too little; more: a "
        "poor calibration is used for longer")
    calibrate_most: int = tuned(200, unit="frames", source="a map of so many is adjusted anew in 2 s",
        effect="beyond which it does not look any more; fewer: walks that show little keep a poor camera; more: frames "
        "wait for the map")
    calibrate_frames: int = tuned(15, unit="frames", source="twice what it takes at 30 Hz",
        effect="that a calibrator may take in the background for its first look, and in proportion for later ones; "
        "fewer: the stream waits for it, and live frames are lost; more: later")
    calibrate_s: float = tuned(0.5, unit="s", source="as calibrate_frames",
        effect="as calibrate_frames, in a slow stream")
    taken_back: float = tuned(0.015, unit="share of a motion", source="half of what a poor lens errs by on fr1",
        effect="by which a better lens takes back what a poor one had displaced; smaller: displaced for longer; "
        "larger: steps are less exact meanwhile, as by the poor lens")
    patience: float = tuned(5.0, unit="times the time after which a segment begins", source=_BODIES,
        effect="that a camera looks for known places where most of the view moved; smaller: segments begin on bodies; "
        "larger: LOST for longer")
    patience_with_scene: float = tuned(0.25, unit="times the time after which a segment begins", source=_BODIES,
        effect="as patience, where lost views show the scene by themselves; smaller: segments that soon would have "
        "been found again; larger: LOST for longer")
    recent: int = tuned(64, unit="frames", source="two seconds at 30 Hz",
        effect="frames among which that of a second ago is searched; fewer: none at high rates; more: memory")
    near_a_second_s: float = tuned(0.075, unit="s", source="two periods at 30 Hz, rounded up",
        effect="smaller: no motion over a second after a lost frame; larger: the second is inexact")
    bridge_sigma_m_s: float = tuned(0.5, unit="m/s", source="predictions against truth over 1 to 4 frames, fr1",
        effect="how fast a predicted pose gets worse; smaller: too sure; larger: too unsure")
    bridge_sigma_rad_s: float = tuned(1.0, unit="rad/s", source="as bridge_sigma_m_s", effect="as bridge_sigma_m_s")
    repeated_px: float = tuned(0.5, unit="px", source="hands that hold a camera still move it by .2 to .5 px a frame",
        effect="motion since the last image beyond which the same image again is a repetition; smaller: a drawn camera "
        "that comes to rest counts as one; larger: slow motion shows a standstill every second frame")
    interpolation_gap_s: float = tuned(0.2, unit="s", source="as longest_gap_s",
        effect="longest gap over which a final pose is carried to its stamp by the motion to the next one, else by its "
        "own velocity; larger: steps of who walks are lost; smaller: velocities of single frames shake")
    # smoothing
    noise_share: float = tuned(0.5, unit="share of the claimed variance", source="fr1, arena, 2 to 30 Hz",
        effect="can be noise from frame to frame at the most; smaller: quick turns at 4 Hz tremble; larger: the steps "
        "of who walks are smoothed away there")
    steady_share: float = tuned(0.2, unit="share of a period", source=_SWEEP,
        effect="steps that count as one period long; smaller: jittery streams show no jumps; "
        "larger: gaps count as jumps")
# fmt: on


TUNING = in_use(Tuning)
