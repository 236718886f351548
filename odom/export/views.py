"""A recording read for export: once for its trajectory and map, and again for the images that are wanted."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from odom.backend import Odometry, OdometrySettings
from odom.backend.odometry.segmentation import Segmenter
from odom.calibration.mid_run import MidRunCalibrator
from odom.calibration.self_calibration import SelfCalibration
from odom.errors import InputError
from odom.export.rectify import Rectifier
from odom.export.scene import Scene, SceneKeyframe, scene_of
from odom.export.selection import sharpest, sharpness
from odom.frame import Camera, RgbdFrame, Stamp, corrected_depth
from odom.frontend.features.image_scale import scale_of
from odom.frontend.features.images import grey_of
from odom.frontend.matching.optical_flow import follow_there_and_back
from odom.geometry import se3
from odom.geometry.arrays import Array, Image, Index
from odom.rgbd_recording import RgbdRecording
from odom.service.run_calibration import final_calibration

Progress = Callable[[int], None]

_THERE_AND_BACK_PX = 0.5
"""A landmark that does not come back to where it was within this was not found in a neighbour."""


@dataclass(frozen=True, eq=False)
class Survey:
    """A recording's scene as its `camera` sees it, stamps and sharpness of the frames, and what marks other things.

    `off_px` is how far off the calibration given was, where the `camera` is a better one.
    """

    camera: Camera
    scene: Scene
    stamps: tuple[Stamp, ...]
    sharpness: tuple[float, ...]
    segmenter: Segmenter | None = None
    off_px: float | None = None

    def chosen(self, neighbours: int) -> dict[Stamp, Stamp]:
        """Return for each key frame's stamp that of the sharpest image with a pose within so many frames of it."""
        number = {stamp: i for i, stamp in enumerate(self.stamps)}
        keyframes = [number[keyframe.stamp] for keyframe in self.scene.keyframes]
        can_stand = np.isin(self.stamps, self.scene.trajectory.stamps)
        can_stand[keyframes] = True
        best = sharpest(keyframes, np.where(can_stand, self.sharpness, -np.inf).tolist(), neighbours)
        return {self.stamps[k]: self.stamps[b] for k, b in zip(keyframes, best, strict=True)}


@dataclass(frozen=True, eq=False)
class View:
    """An image for export with its depth, as a pinhole camera with pose `T_map_camera` (4 x 4) took them.

    `landmarks` (n) are rows of the scene's points, seen at `uv` (n x 2 px); `T_map_depth` is the camera's pose when
    the depth image was taken; `covariance` (6 x 6, `se3`, camera frame) that of the key frame's pose.
    """

    name: str
    stamp: Stamp
    T_map_camera: Array
    T_map_depth: Array
    color: Image
    depth_mm: NDArray[np.uint16]
    landmarks: Index
    uv: Array
    covariance: Array


def survey(
    recording: RgbdRecording,
    settings: OdometrySettings,
    progress: Progress,
    is_stopped: Callable[[], bool],
    segmenter: Segmenter | None = None,
) -> Survey:
    """Run the odometry over a recording; `progress` is told the frames done, `is_stopped` may end it early.

    Where it finds a better calibration than the recording's, it runs over all of it once more with that: so poses,
    landmarks and images are of one camera. What `segmenter` marks is left out. Raises InputError when no frame has a
    pose.
    """
    calibrator = MidRunCalibrator() if settings.self_calibration else None
    odometry = Odometry(recording.camera, settings, segmenter=segmenter, calibrator=calibrator)
    stamps, values, tracked, is_cut = [], [], 0, False
    for frame in recording:
        try:
            tracked += odometry.process(frame).state.is_trusted
        except InputError:
            continue
        stamps.append(frame.stamp)
        values.append(sharpness(frame.color))
        progress(len(stamps))
        if is_cut := is_stopped():
            break
    poses = odometry.finish()
    share = tracked / max(len(stamps), 1)
    better = SelfCalibration() if is_cut else final_calibration(odometry, has_map=False, tracked=share)
    if better.found is not None:
        again, as_it_is = replace(recording, camera=better.found.camera), {"self_calibration": False}
        surveyed = survey(again, settings.model_copy(update=as_it_is), progress, is_stopped, segmenter)
        return replace(surveyed, off_px=better.off_px)
    scene = scene_of(recording.camera, odometry.timing, poses, odometry.map)
    return Survey(recording.camera, scene, tuple(stamps), tuple(values), segmenter)


def views(survey: Survey, recording: RgbdRecording, neighbours: int = 0, unroll: bool = False) -> Iterator[View]:
    """Yield an image for each key frame, in order of time: the sharpest within `neighbours` frames of it.

    Lens distortion is undone, with `unroll` the rolling shutter too. Depth of what is no part of the scene is 0.
    """
    scene = survey.scene
    rectifier = Rectifier(survey.camera, scene.timing.readout_s if unroll else 0.0)
    chosen = survey.chosen(neighbours)
    wanted = chosen.keys() | chosen.values()
    waiting = {keyframe.stamp: keyframe for keyframe in scene.keyframes}
    held: dict[Stamp, RgbdFrame] = {}
    for frame in recording:
        if frame.stamp not in wanted:
            continue
        held[frame.stamp] = _of_the_scene(frame, survey.segmenter)
        ready = [stamp for stamp in waiting if stamp in held and chosen[stamp] in held]
        for stamp in ready:
            keyframe = waiting.pop(stamp)
            yield _view(scene, survey.camera, keyframe, held[stamp], held[chosen[stamp]], rectifier)
        still = {one for stamp in waiting for one in (stamp, chosen[stamp])}
        held = {stamp: kept for stamp, kept in held.items() if stamp in still}


def _of_the_scene(frame: RgbdFrame, segmenter: Segmenter | None) -> RgbdFrame:
    if segmenter is None:
        return frame
    return replace(frame, depth_mm=np.where(segmenter(frame), np.uint16(0), frame.depth_mm))


def _view(
    scene: Scene, camera: Camera, keyframe: SceneKeyframe, own: RgbdFrame, best: RgbdFrame, rectifier: Rectifier
) -> View:
    uv, landmarks = keyframe.uv, keyframe.landmarks
    T = keyframe.T_map_camera if own is best else scene.pose_of_color(best.stamp)
    if own is not best:
        images = grey_of(own.color), grey_of(best.color)
        uv, is_found = follow_there_and_back(*images, uv, uv, _THERE_AND_BACK_PX, 1.0 / scale_of(camera))
        uv, landmarks = uv[is_found], landmarks[is_found]
    twist = scene.twist_of_color(best.stamp)
    depth_mm = corrected_depth(best.depth_mm, camera.depth)
    sources = rectifier.sources(depth_mm, twist)
    depth_m = se3.apply(se3.inverse(T), scene.points[landmarks])[:, 2]
    rgb = best.color if best.color.ndim == 3 else np.repeat(best.color[..., None], 3, axis=2)
    return View(
        name=f"{best.stamp}",
        stamp=best.stamp,
        T_map_camera=T,
        T_map_depth=scene.pose_of_depth(best.depth_stamp),
        color=rectifier.color(rgb, sources),
        depth_mm=rectifier.depth(depth_mm, sources),
        landmarks=landmarks,
        uv=rectifier.points(uv, depth_m, twist),
        covariance=keyframe.covariance,
    )
