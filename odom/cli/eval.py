"""`odom eval ESTIMATE TRUTH`: how far off a trajectory is."""

from pathlib import Path
from typing import Annotated

import typer


def evaluate(
    estimate: Annotated[Path, typer.Argument(help="Estimated trajectory (TUM text).")],
    truth: Annotated[Path, typer.Argument(help="True trajectory (TUM text).")],
    max_gap: Annotated[float, typer.Option(help="Interpolate truth over gaps up to this many seconds.")] = 0.1,
    relative: Annotated[
        list[Path] | None, typer.Option(help="File of relative poses with covariance, for the NEES; may be repeated.")
    ] = None,
) -> None:
    """Print ATE, RPE and coverage of ESTIMATE against TRUTH.

    Example: odom eval out/trajectory.txt groundtruth.txt --relative out/relative_second.txt
    """
    from odom.evaluation import EvaluationOptions
    from odom.evaluation import evaluate as judge
    from odom.evaluation.files import read_tum
    from odom.evaluation.relative import read_relative, relative_nees

    true = read_tum(truth)
    report = judge(read_tum(estimate), true, EvaluationOptions(max_gap_s=max_gap))
    print(f"matched        {report.matched} / {report.total} poses")
    print(f"ATE            {report.ate_m:.4f} m")
    for name, error in (("RPE a frame", report.rpe_frame), ("RPE 1 s", report.rpe_1s)):
        print(f"{name:<14} {error.rmse_m:.4f} m  {error.rmse_deg:.3f} deg  ({error.pairs} pairs)")
    for path in relative or []:
        values = relative_nees(read_relative(path), true, max_gap)
        print(f"NEES           {values.mean:.2f} (6 is ideal), {values.inside_95:.0%} inside 95 %  {path.name}")
    for note in report.notes:
        print(f"note: {note}")
