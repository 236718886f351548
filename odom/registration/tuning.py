"""The engine's tuned numbers.

"w60" stands for clouds of 400 made-up pairs under a Kinect's noise of which 60 % are wrong, n30 for clouds of 30 pairs.
With each number halved and doubled, the share of right poses, their error and NEES, and the time were measured.
"""

from dataclasses import dataclass

from odom.geometry.tuning import in_use, tuned


# fmt: off
@dataclass(frozen=True)
class Tuning:
    """What the gate and the verdict on its result were tuned with."""

    gate_mu_step: float = tuned(0.4, unit="1, growth of mu per round",
        effect="The growth of mu per round. Half: the gate takes 1.4 times as long and finds no pose more; double: "
        "it takes .7 of the time and loses no pose up to w98.",
        source="H. Yang et al., RA-L 2020, remark on implementation: mu times 1.4")
    gate_begin_share: float = tuned(0.5, unit="1, share of the pairs",
        effect="The gate begins at the mu for which the surrogate is convex for this share. Half: nothing changes; "
        "double: a good prediction saves no time (w30 .36 ms for .27), a wrong one costs less.",
        source="sweep .05 to 1 on w30 to w80, with predictions off by .01 to .6")
    gate_full_precision_mu: float = tuned(0.02, unit="1, mu",
        effect="From this mu on, full covariances are used. Half or double: nothing changes. With 0 they always are, "
        "and w30 takes 1.3 times as long; with .5 n30 is 4 % less accurate.",
        source="sweep 0 to .5: between .01 and .04 nothing changes")
    gate_relinearise_rad: float = tuned(0.05, unit="rad",
        effect="S_k is computed again after a larger turn. Half: it costs more without gain; double: nothing changes "
        "yet; at .5 one of 300 n60w80 is wrong and called sure.",
        source="sweep 0 to .5; a turn of .05 changes S_k by a twentieth of the difference of its axes")
    gate_false_alarms: float = tuned(1e-4, unit="1, expected number of motions by chance",
        effect="A motion that would be found by chance more often is refused. Smaller (1e-8): five true pairs in "
        "eight are refused; larger (1): even four pairs make a motion.",
        source="1 in L. Moisan and B. Stival, IJCV 2004; less here, since a wrong loop costs more than a missed one")
    gate_seeds: int = tuned(120, unit="1, pairs",
        effect="So many are rated as seeds of a consistent set. Half: 3 of 200 w95 and 7 of 60 w98 are lost, in .6 "
        "of the time; double: 6 of 60 w98 more are found, in 1.6 times the time.",
        source="at w95 six true pairs are among 120, so one is nearly always found")
    gate_trials: int = tuned(12, unit="1, sets of pairs",
        effect="So many are tried, the best rated first. Half: 9 of 60 w98 are lost; double: 4 of 60 w98 more are "
        "found, but hopeless clouds take 1.5 times as long.",
        source="sweep on w95, w98, w100: all of w95 are found, a hopeless cloud ends in 5 ms")
    gate_partners: int = tuned(24, unit="1, pairs", source="sweep 12 to 48 on w95 and w98",
        effect="So many pairs consistent with a seed are tried as its partner. Half: 2 of 60 w98 are lost; double: "
        "no more are found.")
    gate_distance_sigmas: float = tuned(3.0, unit="1, sigmas of the difference of two distances",
        effect="Two pairs are consistent where their distances differ by no more. Half: 4 of 60 w98 more are found, "
        "but poses are 15 % less accurate; double: 11 of 60 w98 are lost.",
        source=".997 of a Gaussian; sweep 1.5 to 6 on w80 to w98")
    variance_factor_sigmas: float = tuned(3.0, unit="1, sigmas of the mean of chi-square",
        effect="Covariances grow where residuals are larger by more. Half: they grow by chance, and NEES of w98 is "
        "5.8 for 6.1; double: variances up to 1.25 times those stated are believed (400 pairs).",
        source=".9987 of a Gaussian: grows by chance in one of 750 registrations")
    max_rotation_sigma_rad: float = tuned(0.2, unit="rad",
        effect="A motion whose rotation is less sure is refused. Smaller: so are vague but true motions of few "
        "pairs; larger: some are given whose error is beyond what a covariance of first order describes.",
        source="the second order of a rotation, sigma^2 / 2 = .02 rad, is a tenth of its sigma there")
    min_scatter_sigmas: float = tuned(3.0, unit="1, sigmas of a point's noise across the line of the points",
        effect="Points that scatter less about a line determine no motion. At 1, 41 of 100 rods as thick as their "
        "noise (1 cm) get a pose; double: rods of 5 cm are refused.",
        source=".997 of a Gaussian: so thick a line is none; sweep 1 to 6 on rods of 0 to 20 cm")
# fmt: on


TUNING = in_use(Tuning)
