"""Loops back to a saved map in which a camera is only found: judged by the whole map."""

import numpy as np
from backend.made_up_scene import blank_view
from map_file.made_up_map import CAMERA, make

from odom.backend.loop_closure.graph import SegmentGraph
from odom.backend.loop_closure.verification import contradiction
from odom.backend.map.keyframe import MeasuredLandmarks
from odom.backend.map.memory import open_map, recall
from odom.backend.map.pose_graph import Edge
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.geometry import se3
from odom.map_file.map_file import MapFile

SURE = 1e-6 * np.eye(6)


def test_a_loop_to_another_place_of_a_fixed_map_than_where_the_camera_left_it_is_judged_by_what_lies_between(tmp_path):
    make(tmp_path / "walk.map", 30)
    opened = MapFile(tmp_path / "walk.map", is_written=False)
    map_ = open_map(opened.begin(CAMERA))
    recall(map_, range(30))
    T_camera_map, against = map_.keyframes[5].T_camera_map, 5
    for number in range(30, 40):
        T_camera_map = se3.exp(np.array([0.1, 0.0, 0.0, 0.0, 0.01, 0.0])) @ T_camera_map
        view, nothing = blank_view(number), MeasuredLandmarks.nothing()
        map_.add_keyframe(view, T_camera_map, nothing, ShutterTiming(), against, 1e-4 * np.eye(6))
        against = number
    graph = SegmentGraph.of(map_, 0)
    T_a_b = graph.T_between(20, 39)
    near, far = (se3.exp(np.array([away, 0.0, 0.0, 0.0, 0.0, 0.0])) for away in (0.03, 3.0))
    assert contradiction(graph, Edge(20, 39, T_a_b @ near, SURE, True), 0.0) == ""
    assert "contradicts" in contradiction(graph, Edge(20, 39, T_a_b @ far, SURE, True), 0.0)
    moves = graph.with_closures([Edge(20, 39, T_a_b @ near, SURE, True)]).optimised()
    assert moves.numbers == list(range(30, 40))
    opened.close()
