"""How far each key frame of a saved map may be from its true place in the map as a whole.

The registrations that placed the key frames err, so the map is bent: a camera found near one key frame is as far off
as that key frame is. The pose of the whole is free (the gauge): coordinates are chosen in which the key frames' errors,
in metres and radians, are least. No single key frame, not even the first, is without error.
"""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from odom.backend.map.block_inverse import inverse_blocks
from odom.backend.map.pose_graph import Edge, EdgeArrays, Equations
from odom.geometry import se3
from odom.geometry.arrays import Array, Index


def shape_covariances(T_camera_map: Array, edges: EdgeArrays) -> Array:
    """Return the covariance (K x 6 x 6, `se3`, camera frame) of each pose (K x 4 x 4) in the map that `edges` join.

    Ends of edges are row numbers of poses. Each connected part has coordinates of its own (see the module); a pose that
    no edge joins is exact by definition.
    """
    K = len(T_camera_map)
    joined = coo_matrix((np.ones(len(edges.a)), (edges.a, edges.b)), shape=(K, K))
    parts, label = connected_components(joined, directed=False)
    part = label.astype(np.int64)
    _, held = np.unique(part, return_index=True)
    swing = _swings(T_camera_map, part, parts)
    square = np.zeros((parts, 6, 6))
    np.add.at(square, part, swing.transpose(0, 2, 1) @ swing)
    share = swing @ np.linalg.inv(square)[part]
    own, with_whole = _held_covariances(T_camera_map, edges, held, share)
    whole = np.zeros((parts, 6, 6))
    np.add.at(whole, part, share.transpose(0, 2, 1) @ with_whole)
    across = with_whole @ swing.transpose(0, 2, 1)
    covariance = own - across - across.transpose(0, 2, 1) + swing @ whole[part] @ swing.transpose(0, 2, 1)
    return np.asarray(0.5 * (covariance + covariance.transpose(0, 2, 1)))


def warm_up() -> None:
    """Compile what `shape_covariances` needs, or load it: it is called when a saved map is opened."""
    edge = Edge(0, 1, np.eye(4), np.eye(6))
    shape_covariances(np.tile(np.eye(4), (2, 1, 1)), EdgeArrays.of([edge]))


def _swings(T_camera_map: Array, part: Index, parts: int) -> Array:
    """Return how poses move (K x 6 x 6, camera frame) by a motion of their whole part about its middle."""
    middle = np.zeros((parts, 3))
    np.add.at(middle, part, se3.inverses(T_camera_map)[:, :3, 3])
    middle /= np.bincount(part, minlength=parts)[:, None]
    T_camera_middle = T_camera_map.copy()
    T_camera_middle[:, :3, 3] += (T_camera_map[:, :3, :3] @ middle[part][:, :, None])[:, :, 0]
    return se3.adjoints(T_camera_middle)


def _held_covariances(T_camera_map: Array, edges: EdgeArrays, held: Index, share: Array) -> tuple[Array, Array]:
    """Return the poses' covariances (K x 6 x 6) if those `held` are exact, and their covariances with sum `share`' xi.

    Both are 0 for what is held. The sum is over a part's poses; xi is a pose's error, and its `share` is 6 x 6.
    """
    K = len(T_camera_map)
    own, is_held = np.zeros((K, 6, 6)), np.zeros(K, dtype=np.bool_)
    is_held[held] = True
    if is_held.all():
        return own, np.zeros((K, 6, 6))
    equations = Equations(is_held, edges)
    equations.set_up(T_camera_map)
    equations.factorise()
    pattern = equations.pattern
    diagonal = pattern.start[equations.place[~is_held]]
    own[~is_held] = inverse_blocks(pattern.start, pattern.row, equations.L)[diagonal]
    return own, equations.solved(share)
