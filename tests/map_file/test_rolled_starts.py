"""A camera that wakes anywhere, rolled by any angle, in a map of its own: found within a second, and where it is."""

import pytest
from rolled_starts import Found, looked

pytestmark = [pytest.mark.slow, pytest.mark.timeout(3600)]


def test_a_rolled_camera_is_found_within_a_second_to_centimetres(shared_data, tmp_path):
    found = Found.of(list(looked(shared_data / "tum_fr1_xyz", tmp_path / "half.map", starts=100)))
    print(found)
    assert found.recognised >= 0.95
    assert found.near >= 0.99
    assert found.wrong == 0
