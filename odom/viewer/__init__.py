"""Rerun, live and recorded: its own process, fed from Zenoh only, that may lag, die or start late.

`trail`, `truth` and `clouds` are bounded memories over numpy arrays, `scene` maps wire messages to Rerun entities,
`blueprint` lays the views out, `sinks` says where they are shown and `process` moves messages from one to the other.
Only `scene` and the modules above it import Rerun.
"""

from odom.viewer.settings import ViewerSettings

__all__ = ["ViewerSettings"]
