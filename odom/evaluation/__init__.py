"""How good a trajectory is: time matching, alignment, metrics, calibration against motion capture.

`evaluate(estimate, truth)` gives a `Report`; the modules below it are pure functions on arrays. Reading and writing
files is in `odom.evaluation.files` and `odom.evaluation.relative`, drawing in `odom.evaluation.trajectory_plot`.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from odom.evaluation.alignment import Alignment as Alignment
    from odom.evaluation.alignment import align as align
    from odom.evaluation.metrics import Nees as Nees
    from odom.evaluation.metrics import RelativeError as RelativeError
    from odom.evaluation.metrics import nees as nees
    from odom.evaluation.metrics import relative_error as relative_error
    from odom.evaluation.report import EvaluationOptions as EvaluationOptions
    from odom.evaluation.report import Report as Report
    from odom.evaluation.report import evaluate as evaluate
    from odom.evaluation.trajectory import Trajectory as Trajectory

_MODULES = {
    "Alignment": "alignment",
    "EvaluationOptions": "report",
    "Nees": "metrics",
    "RelativeError": "metrics",
    "Report": "report",
    "Trajectory": "trajectory",
    "align": "alignment",
    "evaluate": "report",
    "nees": "metrics",
    "relative_error": "metrics",
}
"""The module of each name."""
__all__ = list(_MODULES)


def __getattr__(name: str) -> Any:
    """Import a name on first use: who needs one module of this package does not load scipy for the others."""
    if name in _MODULES:
        return getattr(import_module(f"odom.evaluation.{_MODULES[name]}"), name)
    raise AttributeError(name)
