"""The surfaces that a depth image shows: points on an even grid over it, and the plane that each lies on."""

from dataclasses import dataclass

import numpy as np

from odom.frontend.camera.lens import Lens
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.measurement import measure_exactly
from odom.frontend.features.tuning import TUNING
from odom.frontend.features.view import View
from odom.geometry.arrays import Array


@dataclass(frozen=True, eq=False)
class Surfaces:
    """What a view's depth image shows at the middles of rows x columns about square cells, at its middle row's time.

    `rays` (rows x columns x 3) are (x/z, y/z, 1/z) in the camera's frame, NaN where there is no depth or an edge of it.
    `planes` (rows x columns x 3, 1/m) are the vectors m whose dot product with any point of the plane there is 1, so
    that the inverse depth seen along a ray (x/z, y/z, 1) is its dot product with m. `variance` (rows x columns, 1/m^2)
    is that of the inverse depth. The view was seen through `lens`.
    """

    rays: Array
    planes: Array
    variance: Array
    lens: Lens

    @classmethod
    def of(cls, view: View, sensor: SensorModel, twist: Array) -> "Surfaces":
        """Return the surfaces of a view that was taken in motion with `twist` (6, SI, camera frame)."""
        height, width = view.depth_mm.shape
        rows, columns = (max(1, round(side * TUNING.surface_columns / width)) for side in (height, width))
        v, u = ((np.arange(n) + 0.5) * side / n - 0.5 for n, side in ((rows, height), (columns, width)))
        uv = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
        measured = measure_exactly(view, sensor, uv, twist).straight(sensor.depth_tilt.angles)
        rays = measured.values
        rays[~view.stands(uv), 2] = np.nan
        slope = measured.slope * sensor.lens.intrinsics[:2]
        ahead = rays[:, 2] - np.einsum("ij,ij->i", rays[:, :2], slope)
        planes = np.column_stack([slope, ahead])
        variance = np.ascontiguousarray(measured.covariance[:, 3])
        grid = rows, columns
        return cls(rays.reshape(*grid, 3), planes.reshape(*grid, 3), variance.reshape(grid), sensor.lens)
