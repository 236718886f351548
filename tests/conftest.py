"""Fixtures that every test may use."""

import os
from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("shared-machine", deadline=None, derandomize=True)
settings.load_profile("shared-machine")


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real recordings, or a skip that says where it was looked for."""
    folder = Path(os.environ.get("ODOM_SHARED_DATA", Path(__file__).parents[2] / "shared" / "data"))
    if not (folder / "tum_fr1_xyz" / "rgb.txt").is_file():
        pytest.skip(f"no real recordings at {folder}: set ODOM_SHARED_DATA to the folder that holds tum_fr1_xyz")
    return folder
