"""The tuned numbers of the camera model (see `geometry.tuning`)."""

from dataclasses import dataclass

from odom.geometry.tuning import SWEEP, in_use, tuned

_KINECT = "what Kinect v1 streams show; swept in odom/docs/sensitivity.md"


# fmt: off
@dataclass(frozen=True)
class Tuning:
    """Numbers of stamps, noise, timing and the depth camera's tilt."""

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
    clock_uneven: float = tuned(1.5, unit="ratio of quartiles", source="of a stream without every third frame: 2",
        effect="Where steps differ by more, the period may be the lower quartile. Smaller: it costs more; larger: "
        "missing frames are taken for jitter.")
    clock_even: float = tuned(0.1, unit="share of a period", source="jittering and thinned stamps, made up",
        effect="The lower quartile is the period if stamps are off by less. Smaller: missing frames are taken for "
        "jitter; larger: jitter is taken for missing frames.")
    clock_most_unsteady: float = tuned(0.25, unit="share of a period", source=_KINECT,
        effect="Stamps that jitter more are taken as they are. Smaller: jittery clocks are not smoothed; larger: a "
        "line is drawn through stamps that have no period.")
    clock_most_unsteady_whole: float = tuned(0.4, unit="share of a period", source="stamps made up with all jitters",
        effect="As clock_most_unsteady, where no frame seems to be missing: then stamps without a period stray far.")
    clock_least_white: float = tuned(0.25, unit="half of von Neumann's ratio",
        source="by chance 1.1 +- .2 (J. von Neumann 1941), never below .4; on made-up streams .25 to .5 tried",
        effect="Stamps are taken as they are where their distances from the line are less white: the rate changes. "
        "Smaller: such changes pass for jitter; larger: a few late stamps in a row pass for a change.")
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
    noise_gain: float = tuned(0.05, unit="1 a frame", source=SWEEP,
        effect="The weight of the newest frame where noise is learnt. Smaller: it is learnt late; larger: the "
        "covariance trembles with each frame.")
    noise_least: int = tuned(15, unit="residuals", source=SWEEP,
        effect="Noise is learnt from at least so many at a time. Fewer: medians are of too few; more: the noise of "
        "depth far away is never learnt.")
    noise_range: float = tuned(8.0, unit="1", source="bounds far beyond any camera met so far",
        effect="The noise may be so many times larger or smaller than assumed at first. Smaller: other cameras are "
        "misjudged; larger: it takes longer to come back.")
    noise_unproven: float = tuned(5.0, unit="variance ratio", source=SWEEP,
        effect="Covariances are inflated so much before anything was seen. Smaller: the first poses are too sure; "
        "larger: they are too unsure.")
    noise_most: float = tuned(50.0, unit="variance ratio", source=SWEEP,
        effect="Comparing the halves of one frame says at most this. Smaller: errors of calibration are underrated; "
        "larger: one bad frame counts for long.")
    noise_most_jump: float = tuned(100.0, unit="variance ratio", source=SWEEP,
        effect="One jump between poses says at most this; otherwise as noise_most.")
    noise_calibration_error: float = tuned(0.005, unit="share of a motion, a unit of inflation^.5", source="a focal "
        "length .5 and 1.5 % off in a walk of the arena: an inflation of 2.4 and 5.9, of 1.4 with the right one; fr1",
        effect="The error of a long motion where the calibration is wrong. Smaller: such motions are too sure; "
        "larger: false loop closures pass.")
    noise_explained: float = tuned(1.5, unit="variance ratio", source="as noise_calibration_error",
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
    timing_memory: float = tuned(0.95, unit="1 an adjustment", source=SWEEP,
        effect="So much of what was known of the timing is kept at each adjustment. Smaller: shutter and lag stay "
        "noisy; larger: changes are followed late.")
# fmt: on


TUNING = in_use(Tuning)
