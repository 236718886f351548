"""What the background has found about new key frames: the places they show, and earlier ones that look like them."""

from dataclasses import dataclass

from odom.backend.mapping.keyframe_inserter import KeyframeView
from odom.frontend.features.place_descriptor import Place
from odom.frontend.matching.place_recognition import Recognition


@dataclass(frozen=True, eq=False)
class DescribedKeyframe:
    """The place that a key frame shows, and the earlier ones that look like it."""

    seen: KeyframeView
    place: Place
    recognitions: list[Recognition]
