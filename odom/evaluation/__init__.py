"""How good a trajectory is: time matching, alignment, metrics, calibration against motion capture.

`evaluate(estimate, truth)` gives a `Report`; the modules below it are pure functions on arrays. Reading and writing
files is in `odom.evaluation.files` and `odom.evaluation.relative`, drawing in `odom.evaluation.trajectory_plot`.
"""

from odom.evaluation.alignment import Alignment, align
from odom.evaluation.metrics import Nees, RelativeError, nees, relative_error
from odom.evaluation.report import EvaluationOptions, Report, evaluate
from odom.evaluation.trajectory import Trajectory

__all__ = [
    "Alignment",
    "EvaluationOptions",
    "Nees",
    "RelativeError",
    "Report",
    "Trajectory",
    "align",
    "evaluate",
    "nees",
    "relative_error",
]
