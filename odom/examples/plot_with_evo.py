"""Run the odometry over a recording and have evo plot it against truth. Arguments: RECORDING OUT.png."""

import sys

from evo.core import metrics, sync
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
both = [PoseTrajectory3D(poses_se3=list(t.T_world_body), timestamps=1e-9 * t.stamps) for t in (truth, estimate)]
reference, estimated = sync.associate_trajectories(*both, max_diff=0.01)
estimated.align(reference)
ape = metrics.APE(metrics.PoseRelation.translation_part)
ape.process_data((reference, estimated))
print(f"evo {ape.get_statistic(metrics.StatisticsType.rmse):.4f} m, odom {odom.evaluate(estimate, truth).ate_m:.4f} m")
pyplot.switch_backend("Agg")
figure = pyplot.figure()
plot.trajectories(figure, {"truth": reference, "odom": estimated}, plot.PlotMode.xz)
figure.savefig(sys.argv[2])
