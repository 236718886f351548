"""What the doctor's tests share: images that most faults leave as they are, are measured once."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from xxhash import xxh3_128_digest

from odom.evaluation.diagnosis import depth, edges, image, tracks

_MEASURES = (
    (tracks, "follow_there_and_back"),
    (tracks, "_corners"),
    (edges, "_gradients"),
    (image, "blur"),
    (depth, "noise_ratio"),
)
"""Functions of arrays alone, which take most of the doctor's time."""


@pytest.fixture(scope="module")
def followed_once() -> Iterator[None]:
    """Equal arrays are measured once: two thirds of the doctor's work."""
    with pytest.MonkeyPatch.context() as patch:
        for module, name in _MEASURES:
            patch.setattr(module, name, _remembered(getattr(module, name)))
        patch.setattr(edges, "depth_edges", _remembered_draws(edges.depth_edges))
        yield


def _key(*arrays: Any) -> bytes:
    return b"".join(xxh3_128_digest(np.ascontiguousarray(array)) for array in arrays)


def _remembered(measure: Callable[..., Any]) -> Callable[..., Any]:
    known: dict[bytes, Any] = {}

    def remembered(*arrays: Any) -> Any:
        key = _key(*arrays)
        if key not in known:
            known[key] = measure(*arrays)
        return known[key]

    return remembered


def _remembered_draws(edges_of: Callable[..., Any]) -> Callable[..., Any]:
    """The same for what also draws: the state that the draws leave behind is a part of the result."""
    known: dict[tuple[bytes, int, str], Any] = {}

    def remembered(depth_mm: Any, limit: int, rng: np.random.Generator) -> Any:
        key = _key(depth_mm), limit, str(rng.bit_generator.state)
        if key not in known:
            known[key] = edges_of(depth_mm, limit, rng), rng.bit_generator.state
        found, rng.bit_generator.state = known[key]
        return found

    return remembered
