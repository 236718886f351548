"""An optional hook: a user's segmenter marks what may move, such as people; a wrong mask is ignored and counted."""

from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np

from odom.backend.odometry.tuning import TUNING
from odom.frame import RgbdFrame
from odom.geometry.arrays import Mask

Segmenter = Callable[[RgbdFrame], Any]
"""Returns H x W bool (or uint8, not 0: may move) of the frame's colour image, or None where it has no mask for it."""


class Segmentation:
    """The masks of one camera's frames; `ignored` counts the frames whose mask was not used, by the reason.

    Nothing depends on it: without a mask a frame is tracked as ever.
    """

    def __init__(self, segmenter: Segmenter | None) -> None:
        self._segmenter = segmenter
        self.ignored: Counter[str] = Counter()

    def mask(self, frame: RgbdFrame) -> Mask | None:
        """Return which pixels of a frame (H x W) may move, None without a mask that can be used."""
        if self._segmenter is None:
            return None
        try:
            mask, reason = self._segmenter(frame), ""
        except Exception as error:  # someone else's code: whatever it raises, the frame is tracked without it
            mask, reason = None, f"the segmenter raised {type(error).__name__}: {error}"
        reason = reason or _refusal(mask, frame.depth_mm.shape)
        if reason:
            is_kept = reason in self.ignored or len(self.ignored) < TUNING.mask_reasons
            self.ignored[reason if is_kept else "other reasons"] += 1
        return None if reason else np.asarray(mask != 0)


def _refusal(mask: Any, shape: tuple[int, ...]) -> str:
    """Return what is wrong with a mask of an image of `shape` (rows, columns), empty for a good one."""
    if mask is None:
        return "no mask"
    if not isinstance(mask, np.ndarray) or mask.dtype not in (np.bool_, np.uint8):
        kind = mask.dtype if isinstance(mask, np.ndarray) else type(mask).__name__
        return f"a mask of {kind}: give a numpy array of bool or uint8"
    if mask.shape != shape:
        return f"a mask of shape {mask.shape}: give {shape}, that of the colour image"
    return "the whole view is masked" if np.count_nonzero(mask) > TUNING.mask_most * mask.size else ""
