"""Register two point clouds of a Kinect with the covariances of both; a third of the pairs are wrong."""

import numpy as np
from scipy.spatial.transform import Rotation

import odom

rng = np.random.default_rng(7)
camera, noise = odom.Camera(640, 480, 525.0, 525.0, 319.5, 239.5), odom.KinectV1()
uv, depth_m = rng.uniform((0, 0), (640, 480), (300, 2)), rng.uniform(0.8, 4.0, 300)
source = odom.back_project(camera, uv, depth_m)
covariances_source = odom.point_covariances(noise, camera, uv, depth_m)  # m^2, a Kinect's error grows with depth
T_true = np.eye(4)
T_true[:3, :3], T_true[:3, 3] = Rotation.from_rotvec([0.02, -0.05, 0.01]).as_matrix(), (0.05, 0.0, 0.1)
target = source @ T_true[:3, :3].T + T_true[:3, 3]
covariances_target = odom.point_covariances(noise, camera, uv, target[:, 2])
source += np.array([rng.multivariate_normal(np.zeros(3), C) for C in covariances_source])
target += np.array([rng.multivariate_normal(np.zeros(3), C) for C in covariances_target])
target[:100] = rng.permuted(target[:100], axis=0)

found = odom.register(odom.Pairs(source, target, covariances_source, covariances_target))
sigma_mm = 1000 * np.sqrt(np.diag(found.covariance)[:3])
error_mm = 1000 * np.linalg.norm(found.T_target_source[:3, 3] - T_true[:3, 3])
print(found)
print(f"{found.inliers.sum()} of {len(source)} pairs fit; error {error_mm:.2f} mm, sigma {sigma_mm.round(2)} mm")
