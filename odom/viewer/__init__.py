"""Rerun, live and recorded: its own process, fed from Zenoh only, that may lag, die or start late.

`trail`, `truth` and `clouds` are bounded memories over numpy arrays, `scene` maps wire messages to Rerun entities,
`blueprint` lays the views out, `outputs` says where they are shown and `process` moves messages from one to the other.
The memories, `thinning` and the settings do without Rerun: other processes use some of them.
"""

from odom.viewer.settings import ViewerSettings

__all__ = ["ViewerSettings"]
