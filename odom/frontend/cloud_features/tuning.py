"""The tuned numbers of SIFT3D and CSHOT (see `geometry.tuning`); the odometry uses none of them."""

from dataclasses import dataclass

from odom.geometry.tuning import in_use, tuned

_PAIRS = "pairs of the arena's key poses by both Kinects"
_RESIDUALS = (
    "residuals of right pairs by scale and distance, arena, both Kinects: 7 to 11 mm at 1.5 m, 11 to 16 at 3.5 m"
)


# fmt: off
@dataclass(frozen=True)
class Tuning:
    """Numbers of key points, descriptors and their matching."""

    sift_sigma_m: float = tuned(0.02, unit="m", source=_PAIRS,
        effect="The finest scale of key points. Half: it takes four times as long; double: a third of the key points "
        "is left, and 9 of 15 pairs are registered.")
    sift_octaves: int = tuned(3, unit="1", source=_PAIRS,
        effect="So many times the scale is doubled. Fewer: large, plain things have no key points; more: nothing "
        "changes, since too few points are left.")
    sift_scales: int = tuned(3, unit="1 an octave", source="D. Lowe, IJCV 60, 2004, section 3.2",
        effect="Each octave is smoothed at so many scales. Fewer: a third of the key points is left; more: it takes "
        "longer and finds the same points again.")
    sift_contrast: float = tuned(1.0, unit="grey levels of 255", source=_PAIRS,
        effect="A key point needs at least this contrast. Half: there are key points on noise; double: half of the "
        "key points are left.")
    normal_radius_m: float = tuned(0.05, unit="m", source=_PAIRS,
        effect="Normals are fitted to the points within this. Half: they follow the noise of depth; double: edges "
        "are rounded.")
    cshot_radius_m: float = tuned(0.20, unit="m", source=_PAIRS,
        effect="A descriptor tells of all within this. Half: that says too little; double: what the other view does "
        "not show spoils it.")
    match_ratio: float = tuned(0.95, unit="1, nearest over second distance", source=_PAIRS,
        effect="A match must be so much nearer than the second one. Smaller: fewer pairs, of which more are right; "
        "larger: more pairs, of which more are wrong.")
    key_point_share: float = tuned(0.12, unit="1, standard deviation over the key point's sigma", source=_RESIDUALS,
        effect="The error of a key point in proportion to its scale. Half: key points of coarse octaves count too "
        "much; double: they hardly count.")
    key_point_rad: float = tuned(0.0035, unit="rad, standard deviation seen from the camera", source=_RESIDUALS,
        effect="The error of a key point across the ray. Half: right pairs far away fail the gate; double: wrong "
        "ones pass it.")
# fmt: on


TUNING = in_use(Tuning)
