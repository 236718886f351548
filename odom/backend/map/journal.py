"""What of a map has changed since it was last saved."""

from collections.abc import Iterable
from dataclasses import dataclass, field

from odom.backend.map.saved import SavedDetails


@dataclass(eq=False)
class Journal:
    """Key frames that are new or have moved (`moved`), or whose details changed (`measured`), and registrations.

    `carried` are those of which nothing but the pose changed: a closed loop moves thousands at once.
    `thinned` are those that have lost landmarks: they are saved again at the end, or when they leave memory.
    `set_aside` holds the details of key frames that left memory before they were taken. Nothing is noted unless the
    journal `is_kept`, which it is for a map that is saved.
    """

    is_kept: bool = False
    moved: set[int] = field(default_factory=set)
    carried: set[int] = field(default_factory=set)
    measured: set[int] = field(default_factory=set)
    thinned: set[int] = field(default_factory=set)
    registered: set[tuple[int, int]] = field(default_factory=set)
    set_aside: dict[int, SavedDetails] = field(default_factory=dict)

    def move(self, keyframes: Iterable[int]) -> None:
        """Note that key frames are new, or have new poses or links."""
        if self.is_kept:
            self.moved.update(keyframes)

    def carry(self, keyframes: Iterable[int]) -> None:
        """Note that key frames have new poses, and are otherwise unchanged."""
        if self.is_kept:
            self.carried.update(keyframes)

    def measure(self, keyframes: Iterable[int]) -> None:
        """Note that the details of key frames have changed."""
        if self.is_kept:
            self.measured.update(keyframes)

    def thin(self, keyframes: Iterable[int]) -> None:
        """Note that landmarks of key frames were removed."""
        if self.is_kept:
            self.thinned.update(keyframes)

    def register(self, a: int, b: int) -> None:
        """Note that the registration of two key frames is new or has changed."""
        if self.is_kept:
            self.registered.add((min(a, b), max(a, b)))

    def clear(self) -> None:
        """Forget what has changed: it was taken."""
        self.moved.clear()
        self.carried.clear()
        self.measured.clear()
        self.registered.clear()
        self.set_aside.clear()
