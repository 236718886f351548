"""The chain: links between successive frames, composed into a trajectory that knows nothing of the map's poses.

Where the map's search found the same landmark in both frames it is used; corners that the map does not know are
followed by the chain itself, by patches that it cut earlier or, where few pairs agree, from image to image. The map's
pose only says where to look. Stamp, rolling shutter and the lag of depth are handled as for the map: all is carried to
the time of the image's middle row.

The chain's covariance is joint: neighbouring links share the frame between them, whose errors enter both with opposite
signs (see `shared_errors`). Between the nodes of the pose graph links are added up as if independent, which is never
less than that: a pose graph takes its edges to be independent.
"""

import math
from dataclasses import replace

import numpy as np

from odom.backend.chain.chain_frame import ChainFrame
from odom.backend.chain.closures import ChainNode, Closures
from odom.backend.chain.followed_corners import follow_corners
from odom.backend.chain.named_features import NamedFeatures
from odom.backend.chain.own_corners import OwnCorners, cut_corners
from odom.backend.chain.pairwise import PairwisePose, register_frames
from odom.backend.chain.shared_errors import FrameErrors
from odom.backend.chain.tuning import TUNING
from odom.backend.estimate import ChainPose, RelativePose
from odom.backend.map.map import Map
from odom.backend.map.pose_covariance import common_covariance
from odom.frame import Stamp
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.lens_change import LensChange
from odom.geometry import se3
from odom.geometry.arrays import Array


class Chain:
    """The chain's end: its newest frame, and its `link` to an earlier one (None: there is none).

    `T_chain_camera` is the newest frame's pose at its middle row's time, with the 6 x 6 `covariance` of the motion
    since the chain began, or began anew behind a hole.
    """

    def __init__(self) -> None:
        self.link: RelativePose | None = None
        self.T_chain_camera: Array = np.eye(4)
        self.covariance: Array = np.zeros((6, 6))
        self.closures = Closures()
        self._summed: Array = np.zeros((6, 6))
        self._part = self._steps_back = 0
        self._end: ChainFrame | None = None
        self._start_covariance: Array = np.zeros((6, 6))
        self._corners = OwnCorners.nothing()
        self._errors = FrameErrors.nothing()
        self._after_renewal = 0
        self._next_name = -1

    def extend(self, frame: ChainFrame, T_hint: Array | None, sensor: SensorModel) -> ChainPose:
        """Return the pose of one more frame; `T_hint` is its expected pose in the newest one (None: unknown).

        A frame that cannot be registered leaves a hole: it takes the newest one's pose, and the chain goes on from
        there.
        """
        end, link = self._end, None
        why, features = "nothing in common with the frame before", frame.features
        if end is None:
            why = ""
        elif frame.view.stamp <= end.view.stamp:
            why, self._steps_back = "stamped before the frame before", self._steps_back + 1
        elif T_hint is not None:
            T_camera_chain = se3.inverse(self.T_chain_camera @ T_hint)
            features = features.joined(self._corners.look_for(frame.view, T_camera_chain, frame.twist, sensor))
            now, found = self._registered(end, replace(frame, features=features), T_hint, sensor)
            if isinstance(found, str):
                why = found
            else:
                root = math.sqrt(sensor.noise.covariance_scale)
                shared = self._errors.shared_with(now.names, root * found.of_previous)
                self._errors = FrameErrors.of(now.names, now.measured, root * found.of_current)
                link, why = self._append(end, frame, found, shared, sensor), ""
                self._corners = self._corners.found_again(now.names[found.inliers])
        if link is None:
            self._begin_anew(end, frame, sensor)
            features = frame.features
        self.link, self._end = link, self._renewed(frame, features, sensor)
        return self._described(frame, why, sensor)

    def close(self, map_: Map, is_keyframe: bool, reference: int, sensor: SensorModel) -> None:
        """Make a node of the newest frame if it is due, or if it is the map's newest key frame; look for closures.

        `reference` is the key frame nearest in pose.
        """
        end = self._end
        if end is not None and (is_keyframe or self.closures.are_due(end.view.stamp, self._steps_back)):
            node = self._node(end.view.stamp, map_.keyframes[-1].number if is_keyframe else None)
            self.closures.add(node)
            self.closures.close(node, end.features, reference, map_, sensor)

    def change_lens(self, change: LensChange) -> None:
        """Change to a new lens: recompute by it what the newest frame and the chain's own corners measured."""
        if self._end is not None:
            features = replace(self._end.features, measured=change.measured(self._end.features.measured))
            self._end = replace(self._end, features=features)
        self._corners = self._corners.with_lens_changed(change)

    @property
    def end_features(self) -> NamedFeatures:
        """What the newest frame measured."""
        return NamedFeatures.nothing() if self._end is None else self._end.features

    def end_node(self) -> ChainNode | None:
        """Return the node of the newest frame, a new one if it is none yet; None where there is no frame."""
        if self._end is None:
            return None
        stamp, last = self._end.view.stamp, self.closures.nodes[-1] if self.closures.nodes else None
        if last is not None and (last.stamp, last.steps_back) == (stamp, self._steps_back):
            return last
        return self._node(stamp, None)

    def _node(self, stamp: Stamp, keyframe: int | None) -> ChainNode:
        pose = self.T_chain_camera, self._summed
        return ChainNode(self.closures.taken, stamp, keyframe, *pose, self._part, self._steps_back)

    def _registered(
        self, end: ChainFrame, frame: ChainFrame, T_hint: Array, sensor: SensorModel
    ) -> tuple[NamedFeatures, PairwisePose | str]:
        """Register a frame against the newest one; return what it measured of the features of both, and the pose.

        Where few of them agree, corners are also followed from one image to the other.
        """
        before, now = end.features.in_common_with(frame.features)
        angles = sensor.depth_tilt.angles
        found = register_frames(before.measured.straight(angles), now.measured.straight(angles), T_hint)
        if not isinstance(found, str):
            if np.count_nonzero(found.inliers) >= TUNING.plenty_pairs:
                return now, found
            T_hint = found.T_previous_current
        more_before, more_now = follow_corners(end, frame, before.uv, T_hint, self._next_name, sensor)
        if not len(more_now):
            return now, found
        self._next_name = int(more_now.names[-1]) - 1
        before, now_too = before.joined(more_before), now.joined(more_now)
        found_too = register_frames(before.measured.straight(angles), now_too.measured.straight(angles), T_hint)
        return (now, found) if isinstance(found_too, str) else (now_too, found_too)

    def _append(
        self, end: ChainFrame, frame: ChainFrame, found: PairwisePose, shared: Array, sensor: SensorModel
    ) -> RelativePose:
        """Move the chain's end to a registered frame; return the link between the two stamps.

        `shared` (6 x 6) is the covariance of the last link's error with this one's.
        """
        covariance = sensor.noise.covariance_scale * found.covariance
        self.T_chain_camera = se3.orthonormal(self.T_chain_camera @ found.T_previous_current)
        correlated = se3.adjoint(se3.inverse(found.T_previous_current)) @ shared
        self.covariance = se3.compose_covariance(self.covariance, found.T_previous_current, covariance)
        self.covariance = self.covariance + correlated + correlated.T
        self._summed = se3.compose_covariance(self._summed, found.T_previous_current, covariance)
        T_middles = found.T_previous_current
        T = se3.inverse(end.published.T_middle_stamp) @ T_middles @ frame.published.T_middle_stamp
        covariance = covariance + end.stamp_covariance(sensor) + frame.stamp_covariance(sensor)
        return RelativePose(end.view.stamp, T, covariance, int(np.count_nonzero(found.inliers)))

    def _begin_anew(self, end: ChainFrame | None, frame: ChainFrame, sensor: SensorModel) -> None:
        """Begin the chain anew with a frame at the pose, at its stamp, of the chain's end."""
        T_chain_stamp = self.T_chain_camera if end is None else self.T_chain_camera @ end.published.T_middle_stamp
        self.T_chain_camera = T_chain_stamp @ se3.inverse(frame.published.T_middle_stamp)
        self.covariance, self._summed = np.zeros((6, 6)), np.zeros((6, 6))
        self._part += end is not None
        self._start_covariance = frame.stamp_covariance(sensor)
        self._corners, self._errors, self._after_renewal = OwnCorners.nothing(), FrameErrors.nothing(), 0

    def _renewed(self, frame: ChainFrame, features: NamedFeatures, sensor: SensorModel) -> ChainFrame:
        """Return a frame with all that it measured; cut new corners where too few features are left."""
        if len(features) <= TUNING.corner_renewal * self._after_renewal or not len(self._corners):
            new, cut = cut_corners(frame.view, features.uv, self.T_chain_camera, self._next_name, frame.twist, sensor)
            self._next_name -= len(new)
            self._corners, features = self._corners.joined(new), features.joined(cut)
            self._after_renewal = len(features)
        return ChainFrame(frame.view, features, frame.twist, frame.published)

    def _described(self, frame: ChainFrame, hole: str, sensor: SensorModel) -> ChainPose:
        T_middle_stamp = frame.published.T_middle_stamp
        T_chain_stamp = self.T_chain_camera @ T_middle_stamp
        ends = self._start_covariance + frame.stamp_covariance(sensor)
        ends = ends + common_covariance(T_chain_stamp, sensor.noise.calibration_error)
        covariance = se3.compose_covariance(self.covariance, T_middle_stamp, ends)
        return ChainPose(T_chain_stamp, covariance, hole)
