"""Run the odometry over a recording and have evo plot it against truth. Arguments: RECORDING OUT.png."""

import sys

from evo.core import metrics
from evo.core.trajectory import PoseTrajectory3D
from evo.tools import plot
from matplotlib import pyplot

import odom

recording = odom.read_recording(sys.argv[1])
odometry = odom.Odometry(recording.camera)
for frame in recording:
    odometry.process(frame)
estimate = odom.Trajectory.of(odometry.finish())
body, truth = next(iter(recording.truth().items()))
if body != "camera":  # markers on the camera, on a clock of their own: both are estimated
    truth = odom.calibrate(estimate, truth).camera_truth(truth)
T_true, matched = truth.at(estimate.stamps, 0.1)  # evo itself takes the nearest true pose, some milliseconds away
both = (T_true[matched], estimate.T_world_body[matched])
reference, estimated = (PoseTrajectory3D(poses_se3=list(T), timestamps=1e-9 * estimate.stamps[matched]) for T in both)
estimated.align(reference)
ape = metrics.APE(metrics.PoseRelation.translation_part)
ape.process_data((reference, estimated))
print(f"evo {ape.get_statistic(metrics.StatisticsType.rmse):.4f} m, odom {odom.evaluate(estimate, truth).ate_m:.4f} m")
pyplot.switch_backend("Agg")
figure = pyplot.figure()
plot.trajectories(figure, {"truth": reference, "odom": estimated}, plot.PlotMode.xz)
figure.savefig(sys.argv[2])
