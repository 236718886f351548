import cv2
import pytest

from sensors.arena import ArenaOptions


@pytest.fixture(autouse=True)
def _one_thread() -> None:
    cv2.setNumThreads(1)


@pytest.fixture(scope="session")
def ideal() -> ArenaOptions:
    return ArenaOptions(faults=False)


@pytest.fixture(scope="session")
def faulty() -> ArenaOptions:
    return ArenaOptions()
