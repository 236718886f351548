"""How a camera moved between two views, without a map: as shown by most features, which must lie behind the rest.

Where nothing else moves there is no rest: then they must reach over most of the image. Those on a body do not, unless
it hides nearly all.
"""

import numpy as np

from odom.backend.tracking.consensus import consensus
from odom.backend.tracking.corner_flow import CornerFlow
from odom.backend.tracking.expected_pose import ExpectedPose
from odom.backend.tracking.motion_model import AT_REST
from odom.backend.tracking.other_motions import shows_scene
from odom.backend.tracking.tuning import TUNING
from odom.frontend.camera.sensor_model import SensorModel
from odom.frontend.features.view import View
from odom.frontend.matching.look_back import EarlierView
from odom.geometry.arrays import Array


def scene_motion(earlier: View, view: View, sensor: SensorModel) -> Array | None:
    """Return T_view_earlier, by the scene that both views show; None where bodies cannot be told from the scene."""
    followed = CornerFlow(EarlierView(earlier, np.eye(4), AT_REST), view, AT_REST, sensor).deep
    features = followed.features
    if len(followed.uv) < TUNING.scene_least:
        return None
    found = consensus(features, np.eye(4), ExpectedPose.at_unknown_velocity(np.eye(4), view.since_s(earlier)))
    T = np.eye(4) if found is None else found
    T = followed.fit(T, features.off_px(T) < TUNING.differs_px).T_camera_map
    agrees = features.off_px(T) < TUNING.differs_px
    return T if shows_scene(followed, agrees, view) else None
