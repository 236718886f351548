"""What a frame sees of the map: how much, and over how much of its image."""

from dataclasses import dataclass

from odom.backend.mapping.tuning import TUNING
from odom.frontend.features.image_parts import parts_of
from odom.geometry.arrays import Array
from odom.geometry.numbered import distinct


@dataclass(frozen=True)
class Coverage:
    """What a frame sees: how many `landmarks`, and how many `cells` of the image they lie in."""

    landmarks: int
    cells: int

    @classmethod
    def of(cls, uv: Array) -> "Coverage":
        """Return the coverage by landmarks found at `uv` (n x 2 px)."""
        return cls(len(uv), len(distinct(parts_of(uv, TUNING.coverage_cell_px))))

    def is_worn(self, at_keyframe: "Coverage") -> bool:
        """Return whether too little is left of what was seen `at_keyframe`, right after the last one was made."""
        wanted = min(TUNING.coverage_enough, TUNING.coverage_share_landmarks * at_keyframe.landmarks)
        is_worn_in_part = self.cells < TUNING.coverage_share_cells * at_keyframe.cells
        return self.landmarks < wanted or self.landmarks < TUNING.coverage_least or is_worn_in_part
