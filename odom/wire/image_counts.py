"""Counts of the images of a stream: those given are used, or refused for a reason."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field

UNREADABLE = "cannot be read"
DUPLICATE = "stamp as of the one before"
BACKWARD = "stamp before that of the one before"
STRAY = "stamp far from all others"
SET_BACK = "from before the clock was set back"
NO_COLOR = "no colour image beside it"
OTHER_SIZE = "size of depth, colour and calibration differ"
NOT_CALIBRATED = "before the calibration"
OVERTAKEN = "overtaken by newer ones"
LOST = "lost on the way"
NOT_TRACKABLE = "refused by the odometry"
NOT_REACHED = "not reached before the end"
MISSING = "missing in the recording"

STAMP_REASONS = (DUPLICATE, BACKWARD, STRAY, SET_BACK)
"""Reasons that lie in an image's stamp alone."""


@dataclass
class ImageCounts:
    """`given` images, of which some were `used` and the others `refused`, by reason; some may still wait.

    A depth image is used when it is paired with a colour image.
    """

    given: int = 0
    used: int = 0
    refused: Counter[str] = field(default_factory=Counter)

    def refuse(self, reason: str) -> None:
        """Count an image that was given as not used."""
        self.refused[reason] += 1

    def withdraw(self, reason: str) -> None:
        """Count an image as not used that was counted as used before."""
        self.used -= 1
        self.refused[reason] += 1

    def plus(self, refused: Mapping[str, int]) -> "ImageCounts":
        """Return these counts with further images that were given and refused, by reason."""
        return ImageCounts(
            self.given + sum(refused.values()), self.used, Counter(dict(self.refused)) + Counter(refused)
        )

    def report(self) -> dict[str, object]:
        """Return the entry of report.json."""
        return {"given": self.given, "used": self.used, "refused": {why: n for why, n in self.refused.items() if n}}

    @classmethod
    def of_report(cls, entry: Mapping[str, object]) -> "ImageCounts":
        """Return the counts of an entry of report.json."""
        given, used, refused = entry["given"], entry["used"], entry["refused"]
        assert isinstance(given, int)
        assert isinstance(used, int)
        assert isinstance(refused, Mapping)
        return cls(given, used, Counter(refused))
