"""What the background finds about new key frames: the places they show, and earlier ones that look like them."""

from collections.abc import Sequence
from dataclasses import dataclass

from odom.backend.map.map import Map
from odom.backend.mapping.keyframe_inserter import KeyframeView
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.place_descriptor import Place, describe_place
from odom.frontend.matching.place_recognition import PlaceIndex, Recognition, recognise
from odom.frontend.matching.tuning import TUNING


@dataclass(frozen=True, eq=False)
class DescribedKeyframe:
    """The place that a key frame shows, and the earlier ones that look like it."""

    seen: KeyframeView
    place: Place
    recognitions: list[Recognition]


@dataclass(frozen=True, eq=False)
class PlaceSearch:
    """A key frame whose place is to be described, and searched for in some `rounds`.

    Each has the key frames to leave out, and how many places to try.
    """

    seen: KeyframeView
    rounds: Sequence[tuple[set[int], int]]

    @classmethod
    def of(cls, map_: Map, seen: KeyframeView) -> "PlaceSearch":
        """Return the search for places like the one that a key frame shows, without those it is linked with.

        In doubt, a run falls into segments, and little of what stands is in view: then more places are tried, and
        other segments are searched first, by themselves.
        """
        keyframes, linked = map_.keyframes, map_.linked(seen.keyframe)
        if seen.standing is None:
            return cls(seen, [(linked, TUNING.place_candidates)])
        segment = keyframes[seen.keyframe].segment
        mine = {k.number for k in keyframes if k.segment == segment}
        others = set(map_.remembered) - mine
        apart, near = TUNING.place_candidates_apart, TUNING.place_candidates
        return cls(seen, [(linked | mine, apart), (linked | others, near)])

    def run(self, index: PlaceIndex, sensor: SensorModel) -> DescribedKeyframe:
        """Return the key frame described, with the places of the `index` that look like it."""
        place = describe_place(self.seen.view, sensor, self.seen.twist, around=self.seen.standing)
        found = [one for excluded, most in self.rounds for one in recognise(index, place, excluded, most)]
        return DescribedKeyframe(self.seen, place, found)
