"""The tuned numbers of the calibration from a walk (see `geometry.tuning`)."""

from dataclasses import dataclass

from odom.geometry.tuning import in_use, tuned

_CAMERAS = "cameras met so far, most of them within a half of it"
_WALKS = "fr1_xyz, fr1_rpy and the arena, from an average Kinect's calibration"

_LOOKS = "what is found after 1 to 26 s of fr1_xyz, fr1_rpy and a hololens, against what is found at the end"


# fmt: off
@dataclass(frozen=True)
class Tuning:
    """Numbers of priors, of the fit, and of the decision on its result."""

    # parameters: how well a given calibration is known, one sigma
    prior_timing_s: float = tuned(0.01, unit="s", source=_CAMERAS,
        effect="change of the timing that the odometry found; smaller: stays at it; larger: free where unseen")
    prior_focal: float = tuned(0.06, unit="share of the focal length", source=_CAMERAS,
        effect="smaller: a wrong focal length is mended too little; larger: nonsense is found where nothing shows it")
    other_camera: float = tuned(4.0, unit="sigma of prior_focal", source="an average Kinect's calibration for other "
        "makes' cameras: at most 2.7 (615 px); the arena's camera x .7 and x 1.6: 4.7 and 5.2",
        effect="by which a calibration is another camera's; smaller: an average one is refused; larger: one that leads "
        "to a poor result is begun with")
    prior_centre: float = tuned(0.04, unit="share of the width", source=_CAMERAS,
        effect="smaller: a wrong centre is mended too little; larger: nonsense is found where nothing shows it")
    prior_k1: float = tuned(0.4, unit="1", source=_CAMERAS,
        effect="smaller: wide lenses are mended too little; larger: the image's corners bend without reason")
    prior_k2: float = tuned(1.0, unit="1", source=_CAMERAS, effect="as prior_k1")
    prior_k3: float = tuned(1.0, unit="1", source=_CAMERAS, effect="as prior_k1")
    prior_tangential: float = tuned(0.01, unit="1", source=_CAMERAS, effect="as prior_k1")
    prior_shift_px: float = tuned(3.0, unit="px", source=_CAMERAS,
        effect="smaller: depth beside colour is mended too little; larger: it drifts where nothing shows it")
    prior_baseline_m: float = tuned(0.03, unit="m", source="distance of the two cameras in Kinects, 2.5 to 5 cm",
        effect="smaller: a registration left out is mended too little; larger: it drifts where nothing shows it")
    prior_offset: float = tuned(0.02, unit="1/m", source=_CAMERAS,
        effect="smaller: depth that errs with the range is believed; larger: it drifts against the focal length")
    prior_field: float = tuned(0.02, unit="1", source=_CAMERAS,
        effect="smaller: bent depth is believed; larger: it is bent to hide other errors")
    prior_unit: float = tuned(0.03, unit="share", source="by what the depth of the TUM benchmark's three Kinects was "
        "found to be off: 3.5, 3.1 and 0 %",
        effect="of the unit of depth; smaller: a unit that motion capture shows is mended too little; larger: it "
        "follows a walk that hardly shows it")
    # survey
    motion_window_s: float = tuned(0.07, unit="s", source="velocities against the arena's truth, .035 to .27 s",
        effect="to both sides, over which velocities are read from the trajectory; smaller: noisier; larger: quick "
        "turns are smoothed away")
    # adjustment
    fit_steps: int = tuned(12, unit="steps", source=_WALKS,
        effect="fewer: far calibrations are not reached in one go; more: slower without gain")
    fit_settled: float = tuned(0.1, unit="sigma", source="far below what is claimed",
        effect="largest step that is not made any more; smaller: slower; larger: ends early")
    fit_roughly: float = tuned(0.5, unit="sigma", source="looks at fr1_xyz and fr1_rpy: numbers as with .1, an eighth "
        "of the CPU less", effect="as fit_settled, for the fits that show which numbers a walk determines")
    # standard deviations
    sure_blocks: int = tuned(12, unit="blocks", source="sigmas against the arena's truth",
        effect="of time and of landmarks, within which errors are correlated; fewer: rough sigmas; more: too small")
    sure_moved: float = tuned(0.5, unit="share of the last round's change", source="sigmas against the arena's truth",
        effect="added to each sigma; smaller: too sure of what has not settled; larger: too unsure")
    sure_measured: float = tuned(2.0, unit="1", source="eight walks in the arena, errors of 192 numbers in sigmas: 1.9 "
        "root mean square", effect="factor of the sigmas told, by which the prior is weighed too; smaller: too sure; "
        "larger: too unsure, and too near to the calibration given")
    # decision
    shown_share: float = tuned(0.5, unit="share of the prior's sigma", source="half of what was known before",
        effect="a number surer than that is shown by the walk; smaller: less is calibrated; larger: guesses are given")
    accept_gain: float = tuned(0.01, unit="share of the held-out cost", source=_WALKS,
        effect="least gain on held-out frames; smaller: chance changes the camera; larger: small errors stay")
    restless_chi2: float = tuned(9.0, unit="1", source="three sigma",
        effect="beyond which a landmark is elsewhere; smaller: noise counts as motion; larger: slow motion is missed")
    restless_most: float = tuned(0.05, unit="share of the landmarks", source="1 % and less on fr1, the arena and a "
        "hololens; a body counts with the share of the view it fills",
        effect="elsewhere in most frames; smaller: good walks are refused; larger: what moves bends the lens")
    # self-calibration while a run goes on
    again: float = tuned(2.0, unit="times as many frames", source="cost: a look takes .1 to .2 s of CPU",
        effect="after which another look follows one that found nothing; smaller: costs more; larger: what a longer "
        "walk shows comes late")
    again_soon: float = tuned(1.4, unit="times as many frames", source="cost; twelve starts of fr1_xyz and fr1_rpy",
        effect="the same where the last look found the camera in use off by again_times; smaller: costs more; larger: "
        "a poor camera stays in use for longer")
    again_times: float = tuned(1.0, unit="times the pixels by which the camera found may be off", source="looks from "
        "an average camera: 1.1 to 9; from sheets: .2 to 1.0",
        effect="smaller: good cameras are looked at often; larger: as a larger again_soon")
    change_times: float = tuned(2.0, unit="times the pixels by which the camera found may be off", source=_LOOKS,
        effect="by which the one in use must be off to be changed; smaller: first guesses are used; larger: a poor "
        "camera stays in use until the end")
    change_unsure_px: float = tuned(2.5, unit="px", source=_LOOKS,
        effect="by which the camera found may be off at the most; as change_times")
    # self-calibration of a run, at its end
    self_frames: int = tuned(150, unit="frames", source="time on fr1_xyz",
        effect="newest ones that are looked at; fewer: less is seen of the image's border; more: slower on long walks")
    self_times: float = tuned(12.0, unit="frames that see the usual landmark", source=_WALKS,
        effect="beyond which only some frames are adjusted; fewer: noisier; more: slower, with their square")
    self_observations: int = tuned(5000, unit="observations", source="five draws each of fr1_xyz and fr1_rpy, from "
        "the sheet and from an average camera: mean errors within 2 % of those with 8000",
        effect="fewer: good calibrations look poor by chance, as a third does with 1500; more: slower")
# fmt: on


TUNING = in_use(Tuning)
