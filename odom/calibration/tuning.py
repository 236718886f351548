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
        effect="How far the timing may be from what the odometry found. Smaller: it stays as it was; larger: it is "
        "free where nothing shows it.")
    prior_focal: float = tuned(0.06, unit="share of the focal length", source=_CAMERAS,
        effect="Smaller: a wrong focal length is corrected too little; larger: nonsense is found where nothing shows "
        "it.")
    other_camera: float = tuned(4.0, unit="sigma of prior_focal", source="an average Kinect's calibration for other "
        "makes' cameras: at most 2.7 (615 px); the arena's camera x .7 and x 1.6: 4.7 and 5.2",
        effect="A focal length that is found farther from the given one is another camera's. Smaller: an average "
        "calibration is refused; larger: a calibration is begun from that leads to a poor result.")
    prior_centre: float = tuned(0.04, unit="share of the width", source=_CAMERAS,
        effect="Smaller: a wrong centre is corrected too little; larger: nonsense is found where nothing shows it.")
    prior_k1: float = tuned(0.4, unit="1", source=_CAMERAS,
        effect="Smaller: wide lenses are corrected too little; larger: the image's corners are bent without reason.")
    prior_k2: float = tuned(1.0, unit="1", source=_CAMERAS, effect="as prior_k1")
    prior_k3: float = tuned(1.0, unit="1", source=_CAMERAS, effect="as prior_k1")
    prior_tangential: float = tuned(0.01, unit="1", source=_CAMERAS, effect="as prior_k1")
    prior_shift_px: float = tuned(3.0, unit="px", source=_CAMERAS,
        effect="How far depth may be shifted in the image against colour. Smaller: a shift is corrected too little; "
        "larger: it drifts where nothing shows it.")
    prior_baseline_m: float = tuned(0.03, unit="m", source="distance of the two cameras in Kinects, 2.5 to 5 cm",
        effect="How far apart the two cameras may be where depth was not registered to colour. Smaller: it is "
        "corrected too little; larger: the distance drifts where nothing shows it.")
    prior_offset: float = tuned(0.02, unit="1/m", source=_CAMERAS,
        effect="The constant error of inverse depth. Smaller: depth whose error grows with the range is believed; "
        "larger: it drifts against the focal length.")
    prior_field: float = tuned(0.02, unit="1", source=_CAMERAS,
        effect="How far depth may be bent over the image. Smaller: bent depth is believed; larger: depth is bent to "
        "hide other errors.")
    prior_unit: float = tuned(0.03, unit="share", source="by what the depth of the TUM benchmark's three Kinects was "
        "found to be off: 3.5, 3.1 and 0 %",
        effect="How far the unit of depth may be off. Smaller: an error that motion capture shows is corrected too "
        "little; larger: the unit follows a walk that hardly shows it.")
    # adjustment
    fit_steps: int = tuned(12, unit="steps", source=_WALKS,
        effect="The fit makes at most so many. Fewer: it does not reach a calibration that is far off in one go; "
        "more: it costs more without gain.")
    fit_settled: float = tuned(0.1, unit="sigma", source="far below what is claimed",
        effect="The fit ends where no step is larger. Smaller: it costs more; larger: it ends too early.")
    fit_roughly: float = tuned(0.5, unit="sigma", source="looks at fr1_xyz and fr1_rpy: parameters as with .1, an "
        "eighth of the CPU less",
        effect="As fit_settled, for the fits that show which parameters a walk determines.")
    # standard deviations
    sure_blocks: int = tuned(12, unit="blocks", source="sigmas against the arena's truth",
        effect="Errors are taken to be correlated within each of so many blocks, of time and of landmarks. Fewer: "
        "sigmas are rough; more: they are too small.")
    sure_moved: float = tuned(0.5, unit="share of the last round's change", source="sigmas against the arena's truth",
        effect="So much of the last change of a parameter is added to its sigma. Smaller: one that has not settled "
        "is too sure; larger: it is too unsure.")
    sure_measured: float = tuned(2.0, unit="1", source="eight walks in the arena, errors of 192 parameters in sigmas: "
        "1.9 root mean square",
        effect="The sigmas reported, and with them the weight of the prior, are multiplied by this. Smaller: the "
        "result is too sure; larger: it is too unsure, and too near to the calibration given.")
    # decision
    shown_share: float = tuned(0.5, unit="share of the prior's sigma", source="half of what was known before",
        effect="A parameter that is surer than this counts as shown by the walk. Smaller: less is calibrated; larger: "
        "guesses are reported.")
    accept_gain: float = tuned(0.01, unit="share of the held-out cost", source=_WALKS,
        effect="A new calibration must gain at least so much on frames held out from the fit. Smaller: the camera is "
        "changed by chance; larger: small errors stay.")
    restless_chi2: float = tuned(9.0, unit="1", source="three sigma",
        effect="An observation beyond this counts as one of a landmark that moved. Smaller: noise counts as motion; "
        "larger: slow motion is missed.")
    restless_most: float = tuned(0.05, unit="share of the landmarks", source="1 % and less on fr1, the arena and a "
        "hololens; a body counts with the share of the view it fills",
        effect="No more may have moved in most of their frames. Smaller: good walks are refused; larger: what moves "
        "bends the lens.")
    # self-calibration while a run goes on
    again: float = tuned(2.0, unit="times as many frames", source="cost: a look takes .1 to .2 s of CPU",
        effect="After a look that found nothing the next one comes when there are so many. Smaller: it costs more; "
        "larger: what a longer walk shows comes late.")
    again_soon: float = tuned(1.4, unit="times as many frames", source="cost; twelve starts of fr1_xyz and fr1_rpy",
        effect="As again, where the last look found the camera in use off by again_times. Smaller: it costs more; "
        "larger: a poor camera stays in use for longer.")
    again_sure: float = tuned(4.0, unit="times as many frames", source="cost; starts of fr1_xyz and fr1_rpy from an "
        "average camera and focal lengths 2.5 and 8 % off: the same are found; a sheet is less often left",
        effect="As again, where the last look was sure to change_unsure_px and found the camera in use good. Smaller: "
        "it costs more; larger: what a much longer walk shows comes at its end.")
    again_times: float = tuned(1.0, unit="times the pixels by which the camera found may be off", source="looks from "
        "an average camera: 1.1 to 9; from sheets: .2 to 1.0",
        effect="A camera in use that is off by more is soon looked at again. Smaller: good cameras are looked at "
        "often; larger: as a larger again_soon.")
    change_times: float = tuned(2.0, unit="times the pixels by which the camera found may be off", source=_LOOKS,
        effect="The camera in use is changed where it is off by more. Smaller: first guesses are used; larger: a "
        "poor camera stays in use until the end.")
    change_unsure_px: float = tuned(2.5, unit="px", source=_LOOKS,
        effect="A camera found that may be off by more is not used, unless change_unsure_times allows it. Smaller: a "
        "poor camera stays in use until the end; larger: first guesses are used.")
    change_unsure_times: float = tuned(3.0, unit="times the pixels by which the camera found may be off", source="two "
        "starts each of fr1_xyz and fr1_rpy with focal lengths of 490 to 640 px, where 517 are true: online errors x "
        ".85, those of the map x .6",
        effect="A camera found that may be off by more than change_unsure_px is used where the one in use is off by so "
        "many times that. Smaller: first guesses are used; larger: another make's camera stays in use until the end.")
    # self-calibration of a run, at its end
    self_frames: int = tuned(150, unit="frames", source="time on fr1_xyz",
        effect="So many are looked at, the newest ones. Fewer: less of the image's border is seen; more: it costs "
        "more on long walks.")
    self_times: float = tuned(12.0, unit="frames that see the usual landmark", source=_WALKS,
        effect="Frames are left out until the usual landmark is seen by no more. Fewer: the result is noisier; more: "
        "it costs more, with their square.")
    self_observations: int = tuned(5000, unit="observations", source="five draws each of fr1_xyz and fr1_rpy, from "
        "the sheet and from an average camera: mean errors within 2 % of those with 8000",
        effect="A look takes at most so many. Fewer: good calibrations look poor by chance, as a third does with "
        "1500; more: it costs more.")
# fmt: on


TUNING = in_use(Tuning)
