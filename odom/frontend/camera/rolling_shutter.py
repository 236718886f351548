"""When each pixel was really seen: rolling shutters of both cameras, and the lag of the depth image.

A Kinect's colour sensor is read out row by row, and its depth image shows the scene some milliseconds before or after
its stamp, at once or also row by row. At 60 degrees a second the top of such an image is more than a degree away from
its bottom; at walking speed the floor's depth is a centimetre older than the wall's. The three numbers are constants of
a device; the back-end estimates them from the stream itself.
"""

from dataclasses import dataclass, replace

import numpy as np

from odom.geometry.arrays import Array
from odom.geometry.compiled import compiled


@dataclass(frozen=True)
class ShutterTiming:
    """The timing of a device, constant over a stream.

    `readout_s`: from the uppermost row of a colour image to the lowest; negative where the lowest is read first, as in
    images that were turned by 180 degrees because the camera hangs upside down. Poses are estimated for the middle row;
    an image is stamped when it is complete, so its stamp is `since_middle_s` later.

    `depth_lag_s`: what must be added to a depth image's stamp to get the time that its middle row shows.

    `depth_readout_s`: as `readout_s`, of a depth image; 0 for a global shutter.
    """

    readout_s: float = 0.0
    depth_lag_s: float = 0.0
    depth_readout_s: float = 0.0

    @property
    def vector(self) -> Array:
        """The three numbers as an array, in this order."""
        return np.array([self.readout_s, self.depth_lag_s, self.depth_readout_s])

    @property
    def since_middle_s(self) -> float:
        """How much later than its middle row's time a colour image is complete, in seconds."""
        return abs(self.readout_s) / 2.0

    @property
    def half_readout(self) -> float:
        """By how much `since_middle_s` grows with the readout: .5, or -.5 where the lowest row is read first."""
        return 0.5 if self.readout_s >= 0.0 else -0.5

    def change_to(self, other: "ShutterTiming") -> Array:
        """Return the `other` vector less this one (3, s), for derivatives by this one.

        Where rows are read the other way round, these derivatives do not hold for `since_middle_s`; the lag makes up
        for it.
        """
        change = other.vector - self.vector
        change[1] += self._bend(other)
        return change

    def changed(self, change: Array) -> "ShutterTiming":
        """Return the timing to which `change` (3, s) leads: `change_to` the other way round."""
        other = ShutterTiming(*(self.vector + change).tolist())
        return replace(other, depth_lag_s=other.depth_lag_s - self._bend(other))

    def by_change_of(self, other: "ShutterTiming") -> Array:
        """Return the derivative (3 x 3) of a change of this timing by a change of the `other` one.

        Where both read their rows the same way round, they are the same change.
        """
        derivative = np.eye(3)
        derivative[1, 0] = other.half_readout - self.half_readout
        return derivative

    def _bend(self, other: "ShutterTiming") -> float:
        """Return by how much `since_middle_s` grows more to the `other` timing than its derivative here says."""
        if other.half_readout == self.half_readout:
            return 0.0
        return other.since_middle_s - self.since_middle_s - self.half_readout * (other.readout_s - self.readout_s)


@compiled
def interaction_matrix(x: float, y: float, w: float, J: Array) -> None:
    """Fill `J` (3 x 6), the derivative of (x/z, y/z, 1/z) of a point by a motion (translation, rotation) of the point.

    Source: F. Chaumette, S. Hutchinson, "Visual servo control", IEEE Robotics & Automation Magazine 13, 2006, where the
    camera moves instead, so that the sign is opposite.
    """
    J[0, 0], J[0, 1], J[0, 2], J[0, 3], J[0, 4], J[0, 5] = w, 0.0, -x * w, -x * y, 1.0 + x * x, -y
    J[1, 0], J[1, 1], J[1, 2], J[1, 3], J[1, 4], J[1, 5] = 0.0, w, -y * w, -1.0 - y * y, x * y, x
    J[2, 0], J[2, 1], J[2, 2], J[2, 3], J[2, 4], J[2, 5] = 0.0, 0.0, -w * w, -y * w, x * w, 0.0


@compiled
def point_flow(x: float, y: float, w: float, twist: Array | tuple[float, ...]) -> tuple[float, float, float]:
    """Return the rates (1/s) of (x/z, y/z, 1/z) of a resting point seen by a camera that moves with `twist`.

    `twist` (6) is the camera's velocity (m/s, rad/s) in its own frame. The rates are minus `interaction_matrix`
    times that.
    """
    tx, ty, tz, rx, ry, rz = twist[0], twist[1], twist[2], twist[3], twist[4], twist[5]
    turn = x * ry - y * rx
    return (
        w * (x * tz - tx) - ry - x * turn + y * rz,
        w * (y * tz - ty) + rx - y * turn - x * rz,
        w * (w * tz - turn),
    )
