"""An estimate judged by truth of the camera, or of a body that it is fixed to."""

from collections.abc import Sequence
from dataclasses import dataclass

from odom.evaluation.mocap_calibration import Calibration, CalibrationOptions, calibrate
from odom.evaluation.report import EvaluationOptions, Report, evaluate
from odom.evaluation.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class Judgement:
    """The `report` by the camera's own `truth`, and the `calibration` by which a body's became that (None: it was)."""

    calibration: Calibration | None
    truth: Trajectory
    report: Report

    @property
    def notes(self) -> Sequence[str]:
        """What the user should know of calibration and report."""
        return [*self.report.notes, *(self.calibration.notes if self.calibration else ())]


def judge(
    estimate: Trajectory, truth: Trajectory, options: EvaluationOptions, mocap: CalibrationOptions | None
) -> Judgement:
    """Judge an estimate by `truth`: of the camera, or where `mocap` is given of a body, which is calibrated by it.

    Raises InputError when too few poses match in time.
    """
    calibration = calibrate(estimate, truth, mocap) if mocap else None
    truth = calibration.camera_truth(truth) if calibration else truth
    return Judgement(calibration, truth, evaluate(estimate, truth, options))
