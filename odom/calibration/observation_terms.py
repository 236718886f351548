"""One observation of a survey against a camera: its residual and derivatives, whitened, in compiled loops.

Residuals are those of the image (pixel, inverse depth as measured), so that neither a longer focal length nor a larger
scale of depth can make them smaller.
"""

import math

from odom.backend.mapping.landmark_elimination import BEHIND_CAMERA_COST
from odom.calibration.parameters import BASELINE, DEPTH, LENS, OFFSET, SCALE, SHIFT, STRETCH, TIMINGS
from odom.frontend.camera.rolling_shutter import interaction_matrix
from odom.geometry.arrays import Array, Index
from odom.geometry.compiled import compiled

_NEAREST_M = 0.05
"""A landmark that comes nearer counts as behind the camera."""
PARAMETERS = DEPTH.stop
"""How many parameters a camera has."""
CameraArrays = tuple[Array, Array, Array]
"""A camera's vector (30), that of the one it was measured with (30), the image's size (2)."""
SeenArrays = tuple[Index, Index, Array, Array, Array, Array, Array]
"""The observations of a survey: `frame`, `landmark`, `uv`, `inverse_depth`, `slope`, `by_timing`, `whitening` (see
`Survey`)."""
_LENS, _SHIFT, _BASELINE, _OFFSET, _SCALE, _STRETCH = (
    part.start for part in (LENS, SHIFT, BASELINE, OFFSET, SCALE, STRETCH)
)


@compiled
def whitened_terms(
    o: int,
    T: Array,
    point: Array,
    camera: CameraArrays,
    seen: SeenArrays,
    cauchy: float,
    J: Array,
    P: Array,
    C: Array,
    r: Array,
) -> float:
    """Fill the residual r (3) of observation `o` and the derivatives of what is predicted; return its robust cost.

    J (3 x 6) is by the pose, perturbed on the left, P (3 x 3) by the `point` (m), C (3 x 30) by the camera's
    parameters. C must be zeros at first: how depth changes with the lens, and the pixel with the depth model, is not
    written. All rows are divided by the standard deviation and multiplied by the root of Cauchy's weight: the first two
    are those of the pixel, the third that of the inverse depth, 0 where none was measured.
    """
    vector, given, size = camera
    _, _, uv, inverse_depth, slope, by_timing, whitening = seen
    X = T[0, 0] * point[0] + T[0, 1] * point[1] + T[0, 2] * point[2] + T[0, 3]
    Y = T[1, 0] * point[0] + T[1, 1] * point[1] + T[1, 2] * point[2] + T[1, 3]
    Z = T[2, 0] * point[0] + T[2, 1] * point[1] + T[2, 2] * point[2] + T[2, 3]
    if Z < _NEAREST_M:
        J[:], P[:], C[:], r[:] = 0.0, 0.0, 0.0, 0.0
        return BEHIND_CAMERA_COST
    w = 1.0 / Z
    x, y = X * w, Y * w
    # the pixel (OpenCV's plumb_bob) and its derivative d by x/z, y/z
    fx, fy, cx, cy = vector[_LENS], vector[_LENS + 1], vector[_LENS + 2], vector[_LENS + 3]
    k1, k2, p1, p2, k3 = (
        vector[_LENS + 4], vector[_LENS + 5], vector[_LENS + 6], vector[_LENS + 7], vector[_LENS + 8]
    )  # fmt: skip
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    by_r2 = k1 + r2 * (2.0 * k2 + 3.0 * r2 * k3)
    bent_x = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)
    bent_y = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y
    across = 2.0 * x * y * by_r2 + 2.0 * p1 * x + 2.0 * p2 * y
    d00, d01 = fx * (radial + 2.0 * x * x * by_r2 + 2.0 * p1 * y + 6.0 * p2 * x), fx * across
    d10, d11 = fy * across, fy * (radial + 2.0 * y * y * by_r2 + 6.0 * p1 * y + 2.0 * p2 * x)
    late_x = late_y = late_w = 0.0
    for t in range(TIMINGS):
        late_x += by_timing[o, 0, t] * vector[t]
        late_y += by_timing[o, 1, t] * vector[t]
        late_w += by_timing[o, 2, t] * vector[t]
    u = uv[o, 0] - fx * bent_x - cx + d00 * late_x + d01 * late_y
    v = uv[o, 1] - fy * bent_y - cy + d10 * late_x + d11 * late_y
    # the lower triangle a whitens it: a' a is the inverse of its covariance, times the weight
    a00, a10, a11 = whitening[o, 0], whitening[o, 1], whitening[o, 2]
    u, v = a00 * u, a10 * u + a11 * v
    unlikely = 1.0 + (u * u + v * v) / cauchy
    root = 1.0 / math.sqrt(unlikely)
    a00, a10, a11, r[0], r[1] = root * a00, root * a10, root * a11, root * u, root * v
    b00, b01 = a00 * d00, a00 * d01
    b10, b11 = a10 * d00 + a11 * d10, a10 * d01 + a11 * d11
    # inverse depth as measured: offset + scale / z, a shift of the pixel times the slope farther on
    from_middle = uv[o, 0] - 0.5 * (size[0] - 1.0), uv[o, 1] - 0.5 * (size[1] - 1.0)
    s, t = from_middle[0] / (0.5 * size[0]), from_middle[1] / (0.5 * size[0])
    terms = (1.0, s, t, s * s, s * t, t * t)
    offset = scale = 0.0
    for k in range(6):
        offset += terms[k] * vector[_OFFSET + k]
        scale += terms[k] * vector[_SCALE + k]
    by_w, measured = scale, inverse_depth[o]
    for k in range(2):
        aside = vector[_BASELINE + k] - given[_BASELINE + k]
        stretch = vector[_STRETCH + k] - given[_STRETCH + k]
        by_w += slope[o, k] * aside
        measured -= slope[o, k] * (vector[_SHIFT + k] - given[_SHIFT + k] + aside * w + stretch * from_middle[k])
    a22 = 0.0
    r[2] = 0.0
    if math.isfinite(measured):
        rest = whitening[o, 3] * (measured - offset - scale * w + scale * late_w)
        doubtful = 1.0 + rest * rest / cauchy
        root = 1.0 / math.sqrt(doubtful)
        a22, r[2] = whitening[o, 3] * root, rest * root
        unlikely *= doubtful
    # derivatives by pose and point
    interaction_matrix(x, y, w, J)
    for k in range(6):
        J[0, k], J[1, k] = b00 * J[0, k] + b01 * J[1, k], b10 * J[0, k] + b11 * J[1, k]
        J[2, k] *= a22 * by_w
    for k in range(3):
        along_x, along_y = w * (T[0, k] - x * T[2, k]), w * (T[1, k] - y * T[2, k])
        P[0, k], P[1, k] = b00 * along_x + b01 * along_y, b10 * along_x + b11 * along_y
        P[2, k] = -a22 * by_w * w * w * T[2, k]
    # derivatives by timing, lens and depth model
    for k in range(TIMINGS):
        C[0, k] = -b00 * by_timing[o, 0, k] - b01 * by_timing[o, 1, k]
        C[1, k] = -b10 * by_timing[o, 0, k] - b11 * by_timing[o, 1, k]
        C[2, k] = -a22 * scale * by_timing[o, 2, k]
    x2, y2, xy = r2 + 2.0 * x * x, r2 + 2.0 * y * y, 2.0 * x * y
    xr, yr = fx * x * r2, fy * y * r2
    u_by = (bent_x, 0.0, 1.0, 0.0, xr, xr * r2, fx * xy, fx * x2, xr * r2 * r2)
    v_by = (0.0, bent_y, 0.0, 1.0, yr, yr * r2, fy * y2, fy * xy, yr * r2 * r2)
    for k in range(9):
        C[0, _LENS + k], C[1, _LENS + k] = a00 * u_by[k], a10 * u_by[k] + a11 * v_by[k]
    for k in range(2):
        C[2, _SHIFT + k] = a22 * slope[o, k]
        C[2, _BASELINE + k] = a22 * slope[o, k] * w
        C[2, _STRETCH + k] = a22 * slope[o, k] * from_middle[k]
    for k in range(6):
        C[2, _OFFSET + k] = a22 * terms[k]
        C[2, _SCALE + k] = a22 * terms[k] * w
    return cauchy * math.log(unlikely)
