"""The chain's links and its accepted closures in one pose graph: how they move each pose of the chain."""

from itertools import pairwise

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from odom.backend.chain.chain import Chain
from odom.backend.chain.closures import ChainNode, closure
from odom.backend.estimate import ChainClosing, ClosedChain, RelativePose
from odom.backend.map.map import Map
from odom.backend.map.pose_graph import Edge, optimise_with_covariance
from odom.frontend.camera.sensor_model import SensorModel
from odom.geometry import se3
from odom.geometry.arrays import Array


def close_chain(chain: Chain, map_: Map, sensor: SensorModel) -> ClosedChain | None:
    """Return the chain adjusted so that its closures hold as well as its links; None where it has not begun.

    Where closures join the two sides of a hole, they give the motion over it; where nothing does, the closed chain
    stands still over the hole, as the chain does. The closing test compares the last frame, registered against the
    first one, with what chain and graph say of it; so the graph leaves out what the last frame itself closes.
    """
    closures, end = chain.closures, chain.end_node()
    if not closures.nodes or end is None:
        return None
    nodes = [*(node for node in closures.nodes if node.number != end.number), end]
    first = nodes[0]
    met = [edge for edge in closures.edges if edge.b != end.number]
    piece = _pieces(nodes, met)
    T_closed, covariance = _closed_poses(nodes, met, piece)
    poses = np.array([T_closed[node.number] for node in nodes])
    moved = np.array([T @ se3.inverse(node.T_chain_camera) for T, node in zip(poses, nodes, strict=True)])
    stamps = np.array([node.stamp for node in nodes], dtype=np.int64)
    closed = se3.inverse(T_closed[first.number]) @ T_closed[end.number]
    closing = None
    if piece[first.part] == piece[end.part]:
        closing = _closing(chain, first, end, map_, sensor, Edge(first.number, end.number, closed, covariance))
    pieces = len(set(piece.values()))
    steps_back = np.array([node.steps_back for node in nodes], dtype=np.int64)
    return ClosedChain(stamps, steps_back, moved, poses, len(closures.edges), closures.refused, pieces, closing)


def _pieces(nodes: list[ChainNode], closures: list[Edge]) -> dict[int, int]:
    """Return the piece that each part of the chain belongs to: parts with a closure between them are one."""
    part_of = {node.number: node.part for node in nodes}
    parts = sorted(set(part_of.values()))
    ends = np.array([[parts.index(part_of[edge.a]), parts.index(part_of[edge.b])] for edge in closures], dtype=np.intp)
    a, b = ends.reshape(-1, 2).T
    joined = coo_array((np.ones(len(a)), (a, b)), shape=(len(parts), len(parts)))
    return dict(zip(parts, connected_components(joined, directed=False)[1].tolist(), strict=True))


def _closed_poses(
    nodes: list[ChainNode], closures: list[Edge], piece: dict[int, int]
) -> tuple[dict[int, Array], Array]:
    """Return T_chain_camera of each node, by number, that agree with links and closures, and the last's covariance.

    Each `piece` of the chain is adjusted by itself with its first node fixed, since the motion between two is unknown.
    Then each is moved so that it begins where the one before it ends. The covariance (6 x 6) is against the first node
    of the last one's piece.
    """
    steps = list(pairwise(nodes))
    links = [a.edge_to(b) for a, b in steps if a.part == b.part]
    begins = {piece[node.part]: node.number for node in reversed(nodes)}
    T_chain = {node.number: node.T_chain_camera for node in nodes}
    held = sorted(begins.values())
    T_closed, covariance = optimise_with_covariance(T_chain, held, [*links, *closures], nodes[-1].number)
    carried = {piece[nodes[0].part]: np.eye(4)}
    for a, b in steps:
        if piece[b.part] not in carried:
            carried[piece[b.part]] = carried[piece[a.part]] @ T_closed[a.number] @ se3.inverse(a.T_chain_camera)
    return {node.number: carried[piece[node.part]] @ T_closed[node.number] for node in nodes}, covariance


def _closing(
    chain: Chain, first: ChainNode, end: ChainNode, map_: Map, sensor: SensorModel, closed: Edge
) -> ChainClosing | None:
    """Return the closing test, None where the last frame does not show what the first one did."""
    if first.keyframe is None or first.keyframe not in map_.remembered or first.number == end.number:
        return None
    chained = first.edge_to(end)
    direct = closure(first.number, map_.keyframes[first.keyframe], end.number, chain.end_features, closed.T_a_b, sensor)
    if direct is None:
        return None
    pose = RelativePose(first.stamp, direct.T_a_b, direct.covariance)
    return ChainClosing(
        pose, chained.T_a_b, _sigmas(direct, chained), closed.T_a_b, _sigmas(direct, closed), chain.link
    )


def _sigmas(direct: Edge, other: Edge) -> float:
    away: Array = se3.log(se3.inverse(other.T_a_b) @ direct.T_a_b)
    return float(np.sqrt(away @ np.linalg.solve(direct.covariance + other.covariance, away)))
