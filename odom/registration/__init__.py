"""The paper: recursive robust registration of point pairs, its baselines and noise models. Pure functions.

Names are imported on first use, so that processes which need only `registration.se3` do not load the compiler.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from odom.registration.default import register, warm_up
    from odom.registration.noise import (
        Generic,
        KinectV1,
        KinectV1Incidence,
        KinectV2,
        NoiseModel,
        ZLevels,
        back_project,
        point_covariances,
    )
    from odom.registration.pairs import Estimator, Pairs, Prior, Registration, Verdict

_HOME = {
    **dict.fromkeys(("register", "warm_up"), "default"),
    **dict.fromkeys(
        (
            "Generic",
            "KinectV1",
            "KinectV1Incidence",
            "KinectV2",
            "NoiseModel",
            "ZLevels",
            "back_project",
            "point_covariances",
        ),
        "noise",
    ),
    **dict.fromkeys(("Estimator", "Pairs", "Prior", "Registration", "Verdict"), "pairs"),
}

__all__ = [
    "Estimator",
    "Generic",
    "KinectV1",
    "KinectV1Incidence",
    "KinectV2",
    "NoiseModel",
    "Pairs",
    "Prior",
    "Registration",
    "Verdict",
    "ZLevels",
    "back_project",
    "point_covariances",
    "register",
    "warm_up",
]


def __getattr__(name: str) -> Any:
    """Import the module that defines `name`."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
