"""Where odom lies in the map: its origin is put where it is known to be, and corrections leave poses in odom alone."""

import numpy as np

from odom.backend.map.pose_covariance import delay_covariance
from odom.backend.odometry.odom_in_map import OdomInMap, Origin
from odom.backend.tracking.motion_model import Velocity
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.geometry import se3

T_MAP_MIDDLE = se3.exp(np.array([0.5, -0.2, 1.0, 0.3, -0.4, 0.2]))
TWIST = np.array([0.3, -0.1, 0.2, 0.4, 0.1, -0.5])
VELOCITY = Velocity(TWIST, 1e-4 * np.eye(6))


def begun():
    """Odom of a segment whose first frame, stamped 1 ms late, was published where its middle row was taken."""
    odom = OdomInMap()
    odom.correct(se3.exp(np.full(6, 0.1)))
    origin = Origin(0, odom.pose(T_MAP_MIDDLE), late_s=0.001)
    odom.origin = origin
    return odom, origin


def test_the_first_frame_lies_at_its_stamp_where_it_was_published_for_every_timing():
    odom, origin = begun()
    for readout_s in (0.024, 0.030, -0.002, 0.0):
        odom.move_origin(odom.origin.with_velocity(VELOCITY, ShutterTiming(readout_s)))
        T_map_stamp = T_MAP_MIDDLE @ se3.exp((0.001 + abs(readout_s) / 2) * TWIST)
        np.testing.assert_allclose(odom.pose(T_map_stamp), origin.T_odom_camera, atol=1e-12)


def test_poses_in_odom_change_by_what_is_returned():
    odom, origin = begun()
    T_map_camera = se3.exp(np.array([1.0, 0.3, 0.2, -0.3, 0.5, 0.9]))
    before = odom.pose(T_map_camera)
    T_new_old = odom.move_origin(origin.with_velocity(VELOCITY, ShutterTiming(0.03)))
    np.testing.assert_allclose(odom.pose(T_map_camera), T_new_old @ before, atol=1e-12)


def test_a_correction_of_the_map_leaves_poses_in_odom_where_they_were():
    odom, _ = begun()
    T_map_camera, T_new_old = se3.exp(np.full(6, 0.3)), se3.exp(np.array([0.1, 0.0, -0.2, 0.05, 0.0, 0.1]))
    before = odom.pose(T_map_camera)
    odom.correct(T_new_old)
    np.testing.assert_allclose(odom.pose(T_new_old @ T_map_camera), before, atol=1e-12)


def test_delays_that_err_alike_do_not_show_in_a_steady_motion():
    A_current_earlier = se3.adjoint(se3.exp(-0.7 * TWIST))
    np.testing.assert_allclose(delay_covariance(A_current_earlier, TWIST, TWIST, 1e-4), 0.0, atol=1e-18)


def test_the_covariance_by_a_delay_is_that_of_sampled_delays():
    rng = np.random.default_rng(3)
    before, after, T_middles = TWIST, rng.normal(0, 0.4, 6), se3.exp(rng.normal(0, 0.5, 6))

    def between_stamps(delay_s):
        return se3.inverse(se3.exp(delay_s * before)) @ T_middles @ se3.exp(delay_s * after)

    T = between_stamps(0.012)
    errors = [se3.log(se3.inverse(T) @ between_stamps(0.012 + e)) for e in rng.normal(0, 1e-4, 2000)]
    sampled = np.cov(np.array(errors).T)
    A = se3.adjoint(se3.inverse(T))
    np.testing.assert_allclose(delay_covariance(A, before, after, 1e-8), sampled, atol=0.1 * np.abs(sampled).max())
