"""Five visits to a laboratory become one map, each as exact as alone; half of its key frames do as well."""

import numpy as np
import pytest
from kidnaps import LAP, T_world_map, away, first_pose, map_of, true_pose
from typer.testing import CliRunner

from odom.cli import app
from odom.evaluation.alignment import align
from odom.geometry import se3
from odom.map_file.map_file import MapFile
from sensors.arena import ArenaOptions

pytestmark = [pytest.mark.slow, pytest.mark.rendered, pytest.mark.timeout(3600)]

VISITS = range(5)
STARTS = 40


def command(*words):
    result = CliRunner().invoke(app, ["map", *map(str, words)], catch_exceptions=False)
    assert result.exit_code == 0
    return result.output


@pytest.fixture(scope="module")
def visits(tmp_path_factory):
    folder = tmp_path_factory.mktemp("visits")
    return [map_of(folder / f"{visit}.map", ArenaOptions(visit=visit)) for visit in VISITS]


@pytest.fixture(scope="module")
def lab(visits):
    path = visits[0].with_name("lab.map")
    assert "part 1" not in command("merge", *visits, "-o", path)
    return path


def error_mm(path, session, visit):
    """The absolute trajectory error (RMS) of a session's key frames against exact truth."""
    mine = [k for k in MapFile(path, is_written=False).keyframes() if k.session == session]
    found = np.array([(se3.inverse(k.T_camera_map) @ k.T_middle_stamp)[:3, 3] for k in mine])
    true = np.array([true_pose(ArenaOptions(visit=visit), k.stamp)[:3, 3] for k in mine])
    off = se3.apply(align(found, true).T_truth_estimate, found) - true
    return 1e3 * float(np.sqrt((off**2).sum(axis=1).mean()))


def test_each_visit_is_as_exact_as_alone(visits, lab):
    for visit, path in enumerate(visits):  # sessions are in the order of their beginnings, as the visits were made
        alone = error_mm(path, 0, visit)
        assert alone < 3.0
        assert error_mm(lab, visit, visit) < 1.2 * alone, visit


def test_any_order_gives_the_same_bytes(visits, lab, tmp_path):
    for seed in range(3):
        path = tmp_path / f"{seed}.map"
        command("merge", *np.random.default_rng(seed).permutation(visits), "-o", path)
        assert path.read_bytes() == lab.read_bytes()


@pytest.mark.parametrize("share", [1.0, 0.5, 0.2])
def test_another_visit_is_found_in_a_part_of_it(lab, tmp_path, share):
    path, count = lab, len(MapFile(lab, is_written=False).keyframes())
    if share < 1.0:
        path = tmp_path / "part.map"
        command("prune", lab, "-o", path, "--keyframes", int(share * count))
    opened = MapFile(path, is_written=False)
    T = T_world_map(opened, ArenaOptions(), 0)
    at_once = 0
    for start in np.linspace(0, LAP - 5, STARTS).astype(int).tolist():
        estimate, truth, before = first_pose(opened, ArenaOptions(visit=5), start, looks=3)
        assert estimate is not None, start
        assert away(estimate, truth, T)[0] < 0.03, start
        at_once += before == 0
    assert at_once > 0.9 * STARTS
