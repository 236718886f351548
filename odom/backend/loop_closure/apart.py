"""Segments still apart when a run ends: places of each are looked for in what all others showed.

While the camera moves, a key frame is held against a few of the places known by then. What was seen later, and the view
of an older key frame, have never met: so some views are kept for the end.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from odom.backend.loop_closure.tuning import TUNING
from odom.backend.map.map import Map
from odom.backend.mapping.keyframe_inserter import KeyframeView
from odom.frontend.matching.place_recognition import Recognition, recognise
from odom.frontend.tuning import TUNING as PLACES


@dataclass(frozen=True, eq=False)
class KeptViews:
    """Views of key frames, in their order: those in doubt, since it is among what moves that a run falls apart."""

    views: tuple[KeyframeView, ...] = ()

    def with_more(self, shown: Iterable[KeyframeView]) -> "KeptViews":
        """Return them with those in doubt of newer key frames; beyond the most that are kept, evenly thinned."""
        kept = [*self.views, *(one for one in shown if one.standing is not None)]
        while len(kept) > TUNING.kept_views:
            number = np.array([one.keyframe for one in kept])
            del kept[1 + int(np.argmin(number[2:] - number[:-2]))]
        return KeptViews(tuple(kept))


def recognised_apart(map_: Map, views: Iterable[KeyframeView]) -> list[tuple[KeyframeView, Recognition]]:
    """Return the views that look like places of other segments than their own, with these, most matches first.

    What the geometry of the matches refuses is left out.
    """
    found: list[tuple[KeyframeView, Recognition]] = []
    for seen in views:
        place = map_.places.place_of(seen.keyframe)
        segment = map_.keyframes[seen.keyframe].segment
        mine = {k.number for k in map_.keyframes if k.segment == segment}
        if place is None or len(mine) == len(map_.keyframes):
            continue
        recognitions = recognise(map_.places, place, mine, PLACES.place_candidates_apart)
        found += [(seen, one) for one in recognitions if not one.refusal]
    return sorted(found, key=_matches, reverse=True)


def _matches(found: tuple[KeyframeView, Recognition]) -> int:
    registration = found[1].registration
    return 0 if registration is None else int(np.count_nonzero(registration.inliers))
