"""The viewer: a process of its own that shows Zenoh's messages in Rerun, and may lag, die or start late.

`scene` turns messages into updates of Rerun entities, `blueprint` arranges the views, `outputs` opens window, web page
or file, and `viewer_process` connects them. `bounded_trajectory`, `truth_alignment`, `keyframe_clouds`, `image_rate`
and the settings do not import Rerun: the odometry process uses some of them.
"""

from odom.viewer.settings import ViewerSettings

__all__ = ["ViewerSettings"]
