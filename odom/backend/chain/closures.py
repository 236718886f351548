"""The chain closed: frames registered against much earlier key frames, and checked against the chain between.

A node is a frame with its pose by the chain alone. Where it measured the same landmarks as a key frame of long ago, the
two are registered as two successive frames are. A registration that contradicts the chain is refused.
"""

from dataclasses import dataclass, field

import numpy as np

from odom.backend.chain.named_features import NamedFeatures
from odom.backend.chain.pairwise import register_frames
from odom.backend.chain.tuning import TUNING
from odom.backend.loop_closure.verification import disagreement
from odom.backend.map.keyframe import Keyframe
from odom.backend.map.map import Map
from odom.backend.map.pose_covariance import independent_covariance
from odom.backend.map.pose_graph import Edge
from odom.frame import Stamp
from odom.frontend.camera.sensor_model import SensorModel
from odom.geometry import se3
from odom.geometry.arrays import Array
from odom.geometry.numbered import places_of, shared


@dataclass(frozen=True, eq=False)
class ChainNode:
    """A frame of the chain, numbered in order; `keyframe` is its number in the map, None where it is no key frame.

    `T_chain_camera` is its pose at its middle row's time, `summed_covariance` (6 x 6, `se3`) that of the motion since
    its `part` of the chain began, with links added up as if independent. Holes separate the parts. `steps_back` is how
    often the chain's stamps had stepped back by then.
    """

    number: int
    stamp: Stamp
    keyframe: int | None
    T_chain_camera: Array
    summed_covariance: Array
    part: int = 0
    steps_back: int = 0

    def edge_to(self, later: "ChainNode") -> Edge:
        """Return the chain's motion to a later node; its covariance is the sums' difference, or a guess over a hole."""
        T = se3.inverse(self.T_chain_camera) @ later.T_chain_camera
        if later.part != self.part:
            return Edge(self.number, later.number, T, TUNING.hole_sigma**2 * np.eye(6))
        A = se3.adjoint(se3.inverse(T))
        covariance = later.summed_covariance - A @ self.summed_covariance @ A.T
        return Edge(self.number, later.number, T, 0.5 * (covariance + covariance.T))


@dataclass
class Closures:
    """The `nodes` of the chain in order, the `edges` that close it, and how many were `refused`.

    `taken` counts all nodes ever made. Beyond `closed_most_nodes` every other node of the older half is removed, with
    its closures.
    """

    nodes: list[ChainNode] = field(default_factory=list)
    edges: list[Edge] = field(default_factory=list)
    refused: int = 0
    taken: int = 0

    def are_due(self, stamp: Stamp, steps_back: int) -> bool:
        """Return whether a frame at `stamp` should become a node, even if it is no key frame.

        The first after a step back of the stamps is one: `steps_back` counts them.
        """
        last = self.nodes[-1] if self.nodes else None
        if last is None or last.steps_back != steps_back:
            return True
        return stamp - last.stamp >= TUNING.closure_every_s * 1e9

    def add(self, node: ChainNode) -> None:
        """Take in a new node, numbered `taken`."""
        self.taken += 1
        self.nodes.append(node)
        if len(self.nodes) > TUNING.closed_most_nodes:
            gone = {one.number for one in self.nodes[1 : len(self.nodes) // 2 : 2]}
            self.nodes = [one for one in self.nodes if one.number not in gone]
            self.edges = [edge for edge in self.edges if not {edge.a, edge.b} & gone]

    def close(self, node: ChainNode, features: NamedFeatures, reference: int, map_: Map, sensor: SensorModel) -> None:
        """Register a node, near key frame `reference`, against those of long ago that share most landmarks with it."""
        near = map_.linked(reference).intersection(map_.remembered)
        until = node.stamp - TUNING.closure_after_s * 1e9
        old = [one for one in self.nodes if one.steps_back != node.steps_back or one.stamp <= until]
        places = [one for one in old if one.keyframe in near]
        keyframes = [map_.keyframes[one.keyframe] for one in places if one.keyframe is not None]
        counts = [int(np.count_nonzero(places_of(each.identities, features.names) >= 0)) for each in keyframes]
        for k in sorted(range(len(places)), key=lambda k: -counts[k])[: TUNING.closures_each]:
            if counts[k] < TUNING.closure_least:
                break
            chained = places[k].edge_to(node)
            edge = closure(places[k].number, keyframes[k], node.number, features, chained.T_a_b, sensor)
            if edge is None or disagreement(chained.T_a_b, chained.covariance, edge, sensor.noise.calibration_error):
                self.refused += 1
            else:
                self.edges.append(edge)


def closure(
    a: int, place: Keyframe, b: int, features: NamedFeatures, T_hint: Array, sensor: SensorModel
) -> Edge | None:
    """Return node `b` registered against node `a` by the landmarks that both measured.

    `a` is the key frame `place`, `b` has measured `features`. `T_hint` is T_a_b as expected. None where they cannot be
    registered.
    """
    here, there = shared(place.identities, features.names)
    change = place.timing.change_to(sensor.timing)  # what was known then may have been a guess
    found = register_frames(
        place.measurements.take(here).retimed(change).straight(sensor.depth_tilt.angles),
        features.measured.take(there).straight(sensor.depth_tilt.angles),
        T_hint,
    )
    if isinstance(found, str):
        return None
    covariance = independent_covariance(sensor.noise.covariance_scale * found.covariance)
    return Edge(a, b, found.T_previous_current, covariance, is_loop=True)
