"""Segments not yet joined when a run ends: the places of each are searched in kept views of all others.

While the camera moves, a key frame is compared with a few of the places known by then, never with later ones. So some
views are kept, and compared with all places at the end.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from odom.backend.loop_closure.tuning import TUNING
from odom.backend.map.map import Map
from odom.backend.mapping.keyframe_inserter import KeyframeView
from odom.frontend.matching.place_recognition import Recognition, recognise
from odom.frontend.matching.tuning import TUNING as PLACES


@dataclass(frozen=True, eq=False)
class KeptViews:
    """Views of key frames in doubt, in order: runs fall apart where much of the view moves."""

    views: tuple[KeyframeView, ...] = ()

    def with_more(self, shown: Iterable[KeyframeView]) -> "KeptViews":
        """Return them with those in doubt of newer key frames; too many are thinned out evenly."""
        kept = [*self.views, *(one for one in shown if one.standing is not None)]
        while len(kept) > TUNING.kept_views:
            number = np.array([one.keyframe for one in kept])
            del kept[1 + int(np.argmin(number[2:] - number[:-2]))]
        return KeptViews(tuple(kept))


def recognised_apart(map_: Map, views: Iterable[KeyframeView]) -> list[tuple[KeyframeView, Recognition]]:
    """Return the views that look like places of other segments than their own, with these, most matches first.

    Those whose matches no motion explains are left out.
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
