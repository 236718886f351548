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

_NAMES = {
    "alignment": "Alignment align",
    "metrics": "Nees RelativeError nees relative_error",
    "report": "EvaluationOptions Report evaluate",
    "trajectory": "Trajectory",
}
_HOME = {name: module for module, names in _NAMES.items() for name in names.split()}

__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    """Import a name on first use: who needs one module of this package does not load scipy for the others."""
    if name in _HOME:
        return getattr(import_module(f"odom.evaluation.{_HOME[name]}"), name)
    raise AttributeError(name)
