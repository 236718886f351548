"""The paper: recursive robust registration of point pairs, its baselines and noise models. Pure functions.

Names are imported on first use, so that processes which need only `registration.se3` do not load the compiler.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from odom.registration.closed_form import horn
    from odom.registration.default import register, warm_up
    from odom.registration.icp import em_icp, wicp
    from odom.registration.kalman_filter import kalman
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
    from odom.registration.recursive import Centroids, RecursiveFilter
    from odom.registration.robust_filter import robust
    from odom.registration.scale import with_scale

__all__ = [
    "Centroids",
    "Estimator",
    "Generic",
    "KinectV1",
    "KinectV1Incidence",
    "KinectV2",
    "NoiseModel",
    "Pairs",
    "Prior",
    "RecursiveFilter",
    "Registration",
    "Verdict",
    "ZLevels",
    "back_project",
    "em_icp",
    "horn",
    "kalman",
    "point_covariances",
    "register",
    "robust",
    "warm_up",
    "wicp",
    "with_scale",
]

_MODULES = {
    "closed_form": ("horn",),
    "default": ("register", "warm_up"),
    "icp": ("em_icp", "wicp"),
    "kalman_filter": ("kalman",),
    "noise": (
        "Generic",
        "KinectV1",
        "KinectV1Incidence",
        "KinectV2",
        "NoiseModel",
        "ZLevels",
        "back_project",
        "point_covariances",
    ),
    "pairs": ("Estimator", "Pairs", "Prior", "Registration", "Verdict"),
    "recursive": ("Centroids", "RecursiveFilter"),
    "robust_filter": ("robust",),
    "scale": ("with_scale",),
}
_HOME = {name: module for module, names in _MODULES.items() for name in names}


def __getattr__(name: str) -> Any:
    """Import the module that defines `name`."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
