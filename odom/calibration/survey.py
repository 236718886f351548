"""The measurements of a recording that calibrate its camera: landmarks seen by key frames and frames between."""

from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np

from odom.backend import Odometry
from odom.backend.map.keyframe import FrameObservations
from odom.backend.mapping.map_adjustment import Adjustment, everything
from odom.backend.mapping.row_motion import carried_anew, rays_as_seen, twists_at
from odom.backend.mapping.steady_slopes import steadied, steady_rise
from odom.calibration.observation_terms import SeenArrays
from odom.calibration.parameters import LENS, OFFSET, SCALE, vector_of
from odom.calibration.projection import project
from odom.calibration.tuning import TUNING
from odom.errors import InputError
from odom.frame import Camera
from odom.frame.depth_model import field_terms
from odom.frontend.features.image_scale import scale_of
from odom.frontend.features.measurement import Measurements
from odom.geometry.arrays import Array, Index, Mask

_LEAST_FRAMES = 8
"""Frames of a survey: fewer show too little for any parameter."""
_SEVERAL = 3
"""Observations of a landmark when some are chosen by chance: fewer say little of the camera."""
MEASURED = ("uv", "inverse_depth", "slope", "by_timing", "variance_uv", "variance_depth", "is_displaced")
"""The arrays of a survey that have a row for each observation, besides `frame` and `landmark`."""


@dataclass(frozen=True, eq=False)
class Survey:
    """N observations of L landmarks in K frames, sorted by landmark, then frame, as measured in the images.

    `frame`, `landmark` (N); `uv` (N x 2, px) where it was seen, carried to the image's middle row; `inverse_depth` (N,
    1/m, NaN: none) as the depth image says, read by the depth model of `camera`; `slope` (N x 2) of that per pixel.
    `by_timing` (N x 3 x 3) is the derivative of x/z, y/z, 1/z; `variance_uv` (N x 3: uu, uv, vv), `variance_depth` (N).
    The `is_displaced` (N) were not where the run's poses predicted them: a poor lens, another thing or motion.
    `T_camera_map` (K x 4 x 4), `landmarks` (L x 3, m) and `is_fixed` (K) are where an adjustment begins; `seconds` (K)
    is when, `recording` (K) in which recording; `camera` the one they were measured with.
    """

    camera: Camera
    frame: Index
    landmark: Index
    uv: Array
    inverse_depth: Array
    slope: Array
    by_timing: Array
    variance_uv: Array
    variance_depth: Array
    is_displaced: Mask
    T_camera_map: Array
    landmarks: Array
    is_fixed: Mask
    seconds: Array
    recording: Index

    def __len__(self) -> int:
        return len(self.frame)

    def part(self, chosen: Mask) -> "Survey":
        """Return the survey with the observations `chosen` (N) alone."""
        return replace(self, **{name: getattr(self, name)[chosen] for name in ("frame", "landmark", *MEASURED)})

    def newest(self, most: int) -> "Survey":
        """Return the survey of the `most` newest frames, of which one is fixed at least."""
        kept = np.zeros(len(self.T_camera_map), dtype=np.bool_)
        kept[np.argsort(self.seconds, kind="stable")[-most:]] = True
        return self.of_frames(kept)

    def every_nth(self) -> Mask:
        """Return every n-th frame (K), n so large that the usual landmark is still seen in `self_times` of them."""
        usual = len(self) / max(len(self.landmarks), 1)
        kept = np.zeros(len(self.T_camera_map), dtype=np.bool_)
        kept[np.argsort(self.seconds, kind="stable")[:: -max(1, int(usual / TUNING.self_times))]] = True
        return kept

    def of_frames(self, kept: Mask) -> "Survey":
        """Return the survey of the frames `kept` (K), of which the first in time is fixed at least."""
        if kept.all():
            return self
        number = np.cumsum(kept) - 1
        is_fixed = self.is_fixed[kept]
        is_fixed[np.argmin(self.seconds[kept])] |= not is_fixed.any()
        seen = self.part(kept[self.frame])
        return replace(
            seen,
            frame=number[seen.frame],
            T_camera_map=self.T_camera_map[kept],
            is_fixed=is_fixed,
            seconds=self.seconds[kept] - self.seconds[kept].min(),
            recording=self.recording[kept],
        )

    def thinned(self, most: int, seed: int) -> "Survey":
        """Return the survey of landmarks drawn at random that have several observations each, about `most` in all."""
        count = np.bincount(self.landmark, minlength=len(self.landmarks))
        drawn = np.random.default_rng(seed).permutation(np.flatnonzero(count >= _SEVERAL))
        drawn = np.sort(drawn[: np.searchsorted(np.cumsum(count[drawn]), most) + 1])
        number = np.full(len(self.landmarks), -1, dtype=np.int64)
        number[drawn] = np.arange(len(drawn))
        seen = self.part(number[self.landmark] >= 0)
        return replace(seen, landmark=number[seen.landmark], landmarks=self.landmarks[drawn])

    @cached_property
    def arrays(self) -> SeenArrays:
        """What compiled loops take of the observations: instead of variances their `whitening` (N x 4).

        a00, a10, a11, with a' a the inverse of the pixel's covariance; the inverse sigma of the inverse depth.
        """
        uu, across, vv = self.variance_uv.T
        u, v = np.sqrt(uu), np.sqrt(vv - across**2 / uu)
        whitening = np.column_stack([1.0 / u, -across / (uu * v), 1.0 / v, 1.0 / np.sqrt(self.variance_depth)])
        return self.frame, self.landmark, self.uv, self.inverse_depth, self.slope, self.by_timing, whitening

    @property
    def terms(self) -> Array:
        """The terms (N x 6) of the depth model's fields at each observation."""
        return field_terms(self.uv, self.camera.width, self.camera.height)


def survey_of(odometry: Odometry) -> Survey:
    """Return the survey of the largest segment of an odometry that has finished, its rays carried by the whole walk."""
    return surveyed(odometry, is_carried_anew=True)[0]


def surveyed(odometry: Odometry, is_carried_anew: bool = False) -> tuple[Survey, Adjustment]:
    """Return the survey of the largest segment of an odometry, and which frames it is of.

    `is_carried_anew`: rays are carried to the middle row's time by the motion of the whole walk (see `row_motion`),
    for which the odometry must have finished. Raises InputError when it holds too few frames to calibrate anything.
    """
    map_, camera = odometry.map, odometry.camera_in_use
    segments = {keyframe.segment for keyframe in map_.keyframes}
    if not segments:
        raise InputError("nothing could be tracked: look at the recording with odom doctor")
    largest = max(sorted(segments), key=lambda number: len(map_.members(number)))
    start = everything(map_, odometry.intermediate, largest, odometry.sensor, credit=1.0)
    between = {each.number: each for each in odometry.intermediate.kept}
    keyframes = [map_.keyframes[number] for number in start.numbers.tolist()]
    others = [between[number] for number in start.between.tolist()]
    frames: list[FrameObservations] = [*keyframes, *others]
    if len(frames) < _LEAST_FRAMES or not len(start.rows):
        raise InputError(f"{len(frames)} frames are linked by common landmarks, too few: walk on for longer")
    seen, frame, landmark, is_displaced = _gathered(frames, odometry, start.rows)
    stamps = [keyframe.stamp for keyframe in keyframes] + [odometry.frames[s.number].stamp for s in others]
    seen = replace(seen, slope=seen.slope * scale_of(camera))  # per pixel of the camera's own image
    R_own_rays = odometry.sensor.lens.R_own_rays
    if camera is not odometry.camera:
        seen = turned(seen, R_own_rays)
    T_camera_map = start.bundle.T_camera_map.copy()
    T_camera_map[:, :3] = R_own_rays @ T_camera_map[:, :3]
    at, points, focal_px = T_camera_map[frame], start.bundle.landmarks[landmark], np.array([camera.fx, camera.fy])
    half_readout = np.array([each.timing.half_readout for each in frames])[frame]
    seen = steadied(seen, at[:, :3, :3], landmark, half_readout, focal_px)
    seen = seen.by_one_timing([each.timing for each in frames], frame, odometry.timing)
    if is_carried_anew:
        numbers = [keyframe.frame for keyframe in keyframes] + [each.number for each in others]
        of_rays = twists_at(numbers, odometry.frames, map_.keyframes, odometry.timing)
        twist = (of_rays.reshape(-1, 3) @ R_own_rays.T).reshape(-1, 6)
        readout_s, depth_m = odometry.timing.readout_s, np.einsum("ni,ni->n", at[:, 2, :3], points) + at[:, 2, 3]
        v = project(rays_as_seen(seen, readout_s), vector_of(camera)[LENS])[0][:, 1]
        seen = carried_anew(seen, v / camera.height - 0.5, 1.0 / depth_m, twist[frame], readout_s)
    vector, S, (fx, fy) = vector_of(camera), seen.covariance, focal_px
    uv, by_direction = project(seen.values[:, :2], vector[LENS])
    terms = field_terms(uv, camera.width, camera.height)
    scale = terms @ vector[SCALE]
    slope = steady_slopes(seen, by_direction, at[:, :3, :3], landmark)
    survey = Survey(
        camera=camera,
        frame=frame,
        landmark=landmark,
        uv=uv,
        inverse_depth=terms @ vector[OFFSET] + scale * seen.values[:, 2],
        slope=slope * scale[:, None],
        by_timing=seen.jacobian_timing,
        variance_uv=np.column_stack([S[:, 0] * fx**2, S[:, 1] * fx * fy, S[:, 2] * fy**2]),
        variance_depth=S[:, 3] * scale**2,
        is_displaced=is_displaced,
        T_camera_map=T_camera_map,
        landmarks=start.bundle.landmarks,
        is_fixed=start.is_fixed,
        seconds=(np.array(stamps) - min(stamps)) * 1e-9,
        recording=np.zeros(len(frames), dtype=np.int64),
    )
    return survey, start


def turned(seen: Measurements, R_own_rays: Array) -> Measurements:
    """Return measurements in a camera's own axes that were given in those of another, a degree or two aside."""
    own = np.column_stack([seen.values[:, :2], np.ones(len(seen))]) @ R_own_rays.T
    return replace(seen, values=np.column_stack([own[:, :2], seen.values[:, 2]]) / own[:, 2:])


def steady_slopes(seen: Measurements, by_direction: Array, R_camera_map: Array, landmark: Index) -> Array:
    """Return the slope of inverse depth per pixel (N x 2) where a landmark's surface has one normal in all frames.

    The slope read in one frame is noisy, and how it differs between the frames that see a landmark is mostly noise:
    a shift of the depth image, which shows in those differences, would be found far too small. `by_direction`
    (N x 2 x 2) is the pixel's derivative by x/z, y/z; `R_camera_map` (N x 3 x 3). NaN becomes 0.
    """
    rise = np.einsum("ni,nij->nj", seen.slope, by_direction)
    steady = steady_rise(seen.values, rise, R_camera_map, landmark)[:, None] @ np.linalg.inv(by_direction)
    return np.nan_to_num(np.where(np.isfinite(seen.values[:, 2:]), steady[:, 0], 0.0), posinf=0.0, neginf=0.0)


def _gathered(
    frames: list[FrameObservations], odometry: Odometry, rows: Index
) -> tuple[Measurements, Index, Index, Mask]:
    """Return measurements of the landmarks in `rows` (ascending): with frame, landmark, and whether displaced (N)."""
    landmarks = odometry.map.landmarks
    numbers, places, displaced, measured = [], [], [], []
    parts = [(k, part) for k, frame in enumerate(frames) for part in (frame, frame.displaced) if part is not None]
    for number, part in parts:
        place = np.searchsorted(rows, part.rows)
        known = rows[np.minimum(place, len(rows) - 1)] == part.rows
        chosen = part.current(landmarks) & known
        one = part.measurements.take(chosen)
        measured.append(one)
        numbers.append(np.full(len(one), number))
        displaced.append(np.full(len(one), part is frames[number].displaced))
        places.append(place[chosen])
    place_of = np.concatenate(places)
    order = np.argsort(place_of, kind="stable")
    found = Measurements(
        *(np.concatenate([getattr(one, f.name) for one in measured])[order] for f in fields(Measurements))
    )
    return found, np.concatenate(numbers)[order], place_of[order], np.concatenate(displaced)[order]
