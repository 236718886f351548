"""When each pixel was really seen: rolling shutters of both cameras, lag of the depth image.

A Kinect's colour sensor is read out row by row, and its depth image shows the scene some milliseconds away from its
stamp, all of it at once or row by row too. At 60 degrees a second the top of such an image is more than a degree away
from its bottom; walking, the floor's depth is a centimetre older than the wall's. The three numbers are constants of a
device; the back-end estimates them from the stream itself.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from odom.registration.compiled import compiled

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Timing:
    """The timing of a device, constant over a stream.

    `readout_s`: from the first row of a colour image to the last. Poses are estimated for the middle row; an image is
    stamped when it is complete, so the stamp is `readout_s / 2` later.

    `depth_lag_s`: what must be added to a depth image's stamp to get the time that its middle row shows.

    `depth_readout_s`: from the first row of a depth image to the last; 0 for a global shutter.
    """

    readout_s: float = 0.0
    depth_lag_s: float = 0.0
    depth_readout_s: float = 0.0

    @property
    def vector(self) -> Array:
        """The numbers as an array (3), in this order."""
        return np.array([self.readout_s, self.depth_lag_s, self.depth_readout_s])

    def changed(self, change: Array) -> "Timing":
        """Return the timing with `change` (3) added to its vector."""
        return Timing(*(self.vector + change).tolist())


@compiled
def point_flow(x: float, y: float, w: float, twist: Array) -> tuple[float, float, float]:
    """Return the rates of (x/z, y/z, 1/z) of a resting point seen by a camera that moves with `twist`.

    `twist` is the camera's velocity (m/s, rad/s) in its own frame. Source: F. Chaumette, S. Hutchinson, "Visual servo
    control", IEEE Robotics & Automation Magazine 13, 2006 (the interaction matrix of a point).
    """
    vx, vy, vz, ox, oy, oz = twist
    return (
        -vx * w + x * vz * w + ox * x * y - oy * (1.0 + x * x) + oz * y,
        -vy * w + y * vz * w + ox * (1.0 + y * y) - oy * x * y - oz * x,
        w * (vz * w + ox * y - oy * x),
    )
