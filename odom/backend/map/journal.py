"""What of a map has changed since it was last saved."""

from collections.abc import Iterable
from dataclasses import dataclass, field

from odom.backend.map.saved import SavedDetails


@dataclass(eq=False)
class Journal:
    """Numbers of key frames by what changed in them, and the pairs of key frames with new `registrations`.

    Of key frames `moved_only` nothing but the pose changed: a closed loop moves thousands at once. Those
    `with_fewer_landmarks` are saved again at the end, or when they leave memory. `set_aside` holds the details of key
    frames that left memory before they were taken. Nothing is noted unless the journal `is_kept`, which it is for a map
    that is saved.
    """

    is_kept: bool = False
    new_or_moved: set[int] = field(default_factory=set)
    moved_only: set[int] = field(default_factory=set)
    with_new_details: set[int] = field(default_factory=set)
    with_fewer_landmarks: set[int] = field(default_factory=set)
    registrations: set[tuple[int, int]] = field(default_factory=set)
    set_aside: dict[int, SavedDetails] = field(default_factory=dict)

    def note_new_or_moved(self, keyframes: Iterable[int]) -> None:
        """Note that key frames are new, or have new poses or links."""
        if self.is_kept:
            self.new_or_moved.update(keyframes)

    def note_moved_only(self, keyframes: Iterable[int]) -> None:
        """Note that key frames have new poses, and are otherwise unchanged."""
        if self.is_kept:
            self.moved_only.update(keyframes)

    def note_new_details(self, keyframes: Iterable[int]) -> None:
        """Note that the details of key frames have changed."""
        if self.is_kept:
            self.with_new_details.update(keyframes)

    def note_fewer_landmarks(self, keyframes: Iterable[int]) -> None:
        """Note that landmarks of key frames were removed."""
        if self.is_kept:
            self.with_fewer_landmarks.update(keyframes)

    def note_registration(self, a: int, b: int) -> None:
        """Note that the registration of two key frames is new or has changed."""
        if self.is_kept:
            self.registrations.add((min(a, b), max(a, b)))

    def clear(self) -> None:
        """Forget what has changed: it was taken."""
        self.new_or_moved.clear()
        self.moved_only.clear()
        self.with_new_details.clear()
        self.registrations.clear()
        self.set_aside.clear()
