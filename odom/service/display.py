"""The display of a command's progress."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from types import TracebackType
from typing import Self


@dataclass(frozen=True)
class Reading:
    """A command's progress: `frames` done of `total`, frames a second, and its state with the reason."""

    frames: int
    total: int | None
    fps: float
    state: str
    reason: str = ""
    unit: str = "frames"


class Display(ABC):
    """Shows readings and the output of the children."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        return None

    @abstractmethod
    def show(self, reading: Reading) -> None:
        """Show how far the run is."""

    @abstractmethod
    def say(self, name: str, line: str) -> None:
        """Show a line of the output of the child `name`."""
