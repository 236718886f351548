import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from odom.backend.map.landmarks import Landmarks
from odom.frontend.features.patches import RADIUS

SIDE = 2 * RADIUS + 1


def add(landmarks, n, mark):
    patches = np.full((n, SIDE, SIDE), mark % 256, dtype=np.uint8)
    return landmarks.add(
        np.full((n, 3), float(mark)), np.zeros((n, 3, 3)), mark, np.zeros((n, 2)), np.zeros((n, 3)), patches, patches
    )


@settings(max_examples=40)
@given(st.lists(st.tuples(st.integers(0, 300), st.floats(0.0, 1.0)), min_size=1, max_size=25), st.integers(0, 99))
def test_rows_used_again_are_never_taken_for_the_landmark_that_was_there(steps, seed):
    rng, landmarks = np.random.default_rng(seed), Landmarks()
    remembered: dict[int, tuple[int, float]] = {}
    for mark, (n, share) in enumerate(steps):
        rows = add(landmarks, n, mark)
        assert len(set(rows.tolist())) == n
        fresh = landmarks.identity[rows].tolist()
        assert remembered.keys().isdisjoint(fresh)
        remembered |= {i: (int(r), float(mark)) for i, r in zip(fresh, rows, strict=True)}
        alive = np.flatnonzero(landmarks.alive)
        landmarks.cull(alive[rng.random(len(alive)) < share])
    for identity, (row, mark) in remembered.items():
        if landmarks.identity[row] == identity:
            assert landmarks.alive[row]
            assert landmarks.position[row, 0] == mark


def test_memory_follows_what_is_alive_not_what_ever_was():
    landmarks = Landmarks()
    for mark in range(100):
        landmarks.cull(add(landmarks, 1000, mark))
    assert len(landmarks.alive) == 4096
