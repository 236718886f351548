"""Every frame's pose relative to a key frame, kept in arrays: 148 bytes a frame, for the last eight hours."""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from odom.frame import Stamp
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.geometry.arrays import Array

_BLOCK = 4096
"""Frames that are allocated, and dropped, together."""
_MOST = 211 * _BLOCK
"""Frames that are kept: eight hours at 30 Hz, 128 MB."""
_LOST = -1
"""Stands for the key frame of a frame that has none."""
_ROW = np.dtype(
    [
        ("stamp", np.int64),
        ("late_s", np.float64),
        ("segment", np.int32),
        ("keyframe", np.int32),
        ("T_keyframe_camera", np.float64, (3, 4)),
        ("position_variance", np.float32),
        ("twist", np.float32, 6),
    ]
)


@dataclass(frozen=True, eq=False)
class LoggedFrame:
    """One frame: `T_keyframe_camera` and its 6 x 6 covariance (`se3`, camera frame); `keyframe` is None when LOST.

    The pose is that at the middle row's time of an image whose stamp came `late_s` seconds late, by the clock of all
    stamps; None: that at the stamp itself. `segment` counts only while the frame is LOST: otherwise its key frame's
    does, which may have been merged with another since. `position_variance` (m^2, mean of three axes) is what a log
    keeps of the covariance, NaN where it is not known. `twist` (6, SI, camera frame) is how the camera moved then, as
    far as that is known.
    """

    stamp: Stamp
    segment: int
    late_s: float | None = None
    keyframe: int | None = None
    T_keyframe_camera: Array | None = None
    covariance: Array | None = None
    position_variance: float = np.nan
    twist: Array | None = None

    def delay_s(self, timing: ShutterTiming) -> float:
        """Return how much later the stamp is than the time of the pose, by a shutter of that `timing`, in seconds."""
        return 0.0 if self.late_s is None else self.late_s + timing.since_middle_s

    def since_s(self, other: "LoggedFrame", timing: ShutterTiming) -> float:
        """Return the seconds from the time of the `other` frame's pose to that of this one's."""
        return (self.stamp - other.stamp) * 1e-9 - self.delay_s(timing) + other.delay_s(timing)


class FrameLog:
    """The newest frames in order, without their covariances; beyond `most` the oldest block is dropped.

    `last` is the newest as it was given, None where there is none. `count` says how many there ever were, `dropped` how
    many of them are gone: those are missing in the final trajectory, but their poses have been published. Only blocks
    that are used take memory.
    """

    def __init__(self, block: int = _BLOCK, most: int = _MOST) -> None:
        self.count = self.dropped = 0
        self._size, self._most = block, most // block
        self._blocks: deque[NDArray[np.void]] = deque()
        self.last: LoggedFrame | None = None

    @property
    def is_lost(self) -> bool:
        """Whether the last frame has no pose, or there is none yet."""
        return self.last is None or self.last.keyframe is None

    def since_last_s(self, stamp: Stamp) -> float:
        """Return the seconds from the last frame to `stamp`, infinite where there is none."""
        return np.inf if self.last is None else (stamp - self.last.stamp) * 1e-9

    def __len__(self) -> int:
        return self.count - self.dropped

    def __iter__(self) -> Iterator[LoggedFrame]:
        for i in range(len(self)):
            yield self._read(i)

    def __getitem__(self, number: int) -> LoggedFrame:
        """Return frame `number`, counted from the first; raises IndexError for one that is gone."""
        if not self.dropped <= number < self.count:
            raise IndexError(f"frame {number} is not among {self.dropped} to {self.count - 1}")
        return self._read(number - self.dropped)

    def move(self, number: int, T_keyframe_camera: Array) -> None:
        """Give frame `number`, which has a pose, another one relative to its key frame, now that it is known better."""
        index = number - self.dropped
        self._blocks[index // self._size][index % self._size]["T_keyframe_camera"] = T_keyframe_camera[:3]

    def append(self, frame: LoggedFrame) -> None:
        """Keep one more frame."""
        if len(self) == len(self._blocks) * self._size:
            if len(self._blocks) == self._most:
                self._blocks.popleft()
                self.dropped += self._size
            self._blocks.append(np.zeros(self._size, dtype=_ROW))
        row = self._blocks[-1][len(self) % self._size]
        row["stamp"], row["segment"] = frame.stamp, frame.segment
        row["late_s"] = np.nan if frame.late_s is None else frame.late_s
        row["keyframe"], row["position_variance"] = _LOST, np.nan
        row["twist"] = np.nan if frame.twist is None else frame.twist
        if frame.keyframe is not None and frame.T_keyframe_camera is not None:
            row["keyframe"], row["T_keyframe_camera"] = frame.keyframe, frame.T_keyframe_camera[:3]
            if frame.covariance is not None:
                row["position_variance"] = np.trace(frame.covariance[:3, :3]) / 3.0
        self.count += 1
        self.last = frame

    def _read(self, index: int) -> LoggedFrame:
        row = self._blocks[index // self._size][index % self._size]
        stamp, segment, late_s = Stamp(int(row["stamp"])), int(row["segment"]), float(row["late_s"])
        late = None if np.isnan(late_s) else late_s
        if row["keyframe"] == _LOST:
            return LoggedFrame(stamp, segment, late)
        T = np.eye(4)
        T[:3] = row["T_keyframe_camera"]
        variance, twist = float(row["position_variance"]), row["twist"].astype(np.float64)
        known = None if np.isnan(twist[0]) else twist
        return LoggedFrame(stamp, segment, late, int(row["keyframe"]), T, position_variance=variance, twist=known)
