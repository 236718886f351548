"""Odometry of frames that are numpy arrays: here the camera moves along a painted wall, 4 mm between frames."""

import numpy as np

import odom

camera = odom.Camera(width=640, height=480, fx=525.0, fy=525.0, cx=319.5, cy=239.5)
odometry = odom.Odometry(camera)
wall = np.random.default_rng(0).integers(0, 256, (60, 120), dtype=np.uint8).repeat(8, axis=0).repeat(8, axis=1)
depth_mm = np.full((480, 640), 2100, np.uint16)  # 0 where nothing was measured

for i in range(60):
    grey = np.ascontiguousarray(wall[:480, i : i + 640])
    color = np.dstack([grey, grey, grey])  # RGB
    stamp = odom.from_seconds(i / 30)
    estimate = odometry.process(odom.RgbdFrame(i, stamp, color, stamp, depth_mm))
    if estimate.T_odom_camera is not None and estimate.covariance is not None:  # None where the camera is LOST
        x, y, z = estimate.T_odom_camera[:3, 3]
        sigma_mm = 1000 * np.sqrt(np.diag(estimate.covariance)[:3])
        print(f"{estimate.state.value} x {x:.4f} y {y:.4f} z {z:.4f} m, sigma {sigma_mm.round(1)} mm")

trajectory = odom.Trajectory.of(odometry.finish())
print(f"{len(trajectory)} poses, {trajectory.length_m:.3f} m in {trajectory.duration_s:.1f} s")
