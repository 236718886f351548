"""Several recordings of one camera are calibrated as one survey."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from odom.calibration.survey import MEASURED, Survey
from odom.errors import InputError


def joined(surveys: Sequence[Survey]) -> Survey:
    """Return the surveys of several recordings of one camera as one; raises InputError for images of other sizes."""
    first = surveys[0]
    sizes = {(s.camera.width, s.camera.height) for s in surveys}
    if len(sizes) > 1:
        raise InputError(f"images of {' and '.join(f'{w} x {h}' for w, h in sorted(sizes))} are of different cameras")
    frames = np.cumsum([0, *(len(s.T_camera_map) for s in surveys)])
    points = np.cumsum([0, *(len(s.landmarks) for s in surveys)])

    def every(name: str) -> Any:
        return np.concatenate([getattr(s, name) for s in surveys])

    ends = np.cumsum([0.0, *(s.seconds.max() + 1.0 for s in surveys)])
    return Survey(
        camera=first.camera,
        frame=np.concatenate([s.frame + at for s, at in zip(surveys, frames, strict=False)]),
        landmark=np.concatenate([s.landmark + at for s, at in zip(surveys, points, strict=False)]),
        **{name: every(name) for name in MEASURED},
        T_camera_map=every("T_camera_map"),
        landmarks=every("landmarks"),
        is_fixed=np.concatenate([s.is_fixed for s in surveys]),
        seconds=np.concatenate([s.seconds + at for s, at in zip(surveys, ends, strict=False)]),
        recording=np.repeat(np.arange(len(surveys)), [len(s.T_camera_map) for s in surveys]),
    )
