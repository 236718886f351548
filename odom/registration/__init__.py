"""Robust recursive registration of point pairs: the engine. `paper/` holds what only the paper's tables need beside it.

Letters, in all modules: pair k is a source point `q` and a target point `p` (n x 3, m) with covariances `Sq`, `Sp`
(n x 3 x 3, m^2; length 0: none). `T = [R | t]` (4 x 4) is the motion sought, `p = R q + t`: eq. (1). The noise of pair
k is `S_k = Sp + R Sq R'`, `W` its inverse (packed, see `measurement_covariance`), `given` the pairs' weights and `g`
those of the moment. `x = vec[R | t]`, row by row, are twelve states (the paper's nine of eq. 10, and t), `Y` their
information and `Y x = y`. `H` (6 x 6) is the information of xi = (translation, rotation) in `T exp(xi)`. `C` is the
measurement matrix, the paper's H_R of eq. (10) extended by t; the paper's R_k is `Sp` here, and `R` always a rotation.

Equation numbers are those of A. Amamra et al., "A Recursive Robust Filtering Approach for 3D Registration". The paper
leaves its filter's formulas (eq. 28) to Y. Hung and F. Yang, Automatica 39, 2003: "Hung and Yang" below. Where the
paper errs, the code that differs says so: eq. (4) in `with_scale`, Algorithm 1 in `kalman`, eq. (21) in `ZLevels`,
eq. (25) in `precisions`, eqs. (14)-(16) in `allow_for_source_noise`; and so does the one that departs for another
reason: theta changes the covariance, not the pose (`discount`).

Names are imported on first use, so that processes which need only the types do not load the compiler.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from odom.registration.gated_registration import register as register
    from odom.registration.gated_registration import warm_up as warm_up
    from odom.registration.noise_models import Generic as Generic
    from odom.registration.noise_models import KinectV1 as KinectV1
    from odom.registration.noise_models import KinectV1Incidence as KinectV1Incidence
    from odom.registration.noise_models import KinectV2 as KinectV2
    from odom.registration.noise_models import NoiseModel as NoiseModel
    from odom.registration.noise_models import ZLevels as ZLevels
    from odom.registration.noise_models import back_project as back_project
    from odom.registration.noise_models import point_covariances as point_covariances
    from odom.registration.pairs import Estimator as Estimator
    from odom.registration.pairs import Pairs as Pairs
    from odom.registration.pairs import Prior as Prior
    from odom.registration.pairs import Registration as Registration
    from odom.registration.pairs import Verdict as Verdict
    from odom.registration.paper.closed_form import horn as horn
    from odom.registration.paper.icp import em_icp as em_icp
    from odom.registration.paper.icp import wicp as wicp
    from odom.registration.paper.kalman_filter import kalman as kalman
    from odom.registration.paper.robust_filter import robust as robust
    from odom.registration.paper.scaled_registration import with_scale as with_scale
    from odom.registration.paper.streaming_filter import Centroids as Centroids
    from odom.registration.paper.streaming_filter import RecursiveFilter as RecursiveFilter

_NAMES = {
    "gated_registration": "register warm_up",
    "noise_models": "Generic KinectV1 KinectV1Incidence KinectV2 NoiseModel ZLevels back_project point_covariances",
    "pairs": "Estimator Pairs Prior Registration Verdict",
    "paper.closed_form": "horn",
    "paper.icp": "em_icp wicp",
    "paper.kalman_filter": "kalman",
    "paper.robust_filter": "robust",
    "paper.scaled_registration": "with_scale",
    "paper.streaming_filter": "Centroids RecursiveFilter",
}
_HOME = {name: module for module, names in _NAMES.items() for name in names.split()}

__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    """Import the module that defines `name`."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    """Return the public names, loaded or not."""
    return __all__
