"""Each tuned number of the chain halved and doubled: a table.

`python -m pytest -m slow -n 0 -s tests/backend/test_chain_sweep.py`: the odometry runs once over each recording and
feeds a chain for each value, since no chain touches the map.
"""

from dataclasses import replace

import numpy as np
import pytest
from test_chained_covariance import arena

from odom import Odometry, read_recording
from odom.backend.chain import chain, closures, own_corners, pairwise, tuning
from odom.backend.chain.closed_chain import close_chain
from odom.evaluation.relative import RelativePoses, relative_nees
from odom.evaluation.report import evaluate
from odom.evaluation.sensitivity import changes, tuned_numbers
from odom.evaluation.trajectory import Trajectory
from odom.evaluation.truth_noise import truth_noise, widened

SECONDS = 5
AS_IT_IS = "as it is"


def variants():
    """The tuning as it is, and with each number halved and doubled, by name."""
    found = {AS_IT_IS: tuning.TUNING}
    for number in tuned_numbers("backend.chain.*"):
        name = number.key.rpartition(".")[2]
        for level, value in changes(number).items():
            found[f"{name} {level.value}"] = replace(tuning.TUNING, **{name: value})
    return found


class Fed:
    """A chain of one tuning, and what it said."""

    def __init__(self, numbers):
        self.numbers, self.chain = numbers, chain.Chain()
        self.poses, self.links, self.holes = {}, [], 0

    def extend(self, extend, frame, T_hint, sensor):
        said = extend(self.chain, frame, T_hint, sensor)
        self.poses[frame.view.stamp] = said.T_chain_camera
        self.holes += bool(said.hole)
        if self.chain.link is not None:
            self.links.append((frame.view.stamp, self.chain.link))

    def figures(self, map_, sensor, truth):
        """ATE of chain and closed chain (m), drift of the chain over 1 s (m), NEES of a link, holes."""
        stamps = np.array(sorted(self.poses))
        closed = close_chain(self.chain, map_, sensor)
        chained = Trajectory(stamps, np.array([self.poses[stamp] for stamp in stamps]))
        met = Trajectory(stamps, np.array([closed.moved(stamp, self.poses[stamp]) for stamp in stamps]))
        report, links = evaluate(chained, truth), RelativePoses.of(self.links)
        links = widened(links, truth_noise(truth))
        second = report.rpe_1s.rmse_m
        return report.ate_m, evaluate(met, truth).ate_m, second, relative_nees(links, truth).mean, self.holes


def swept(camera, frames, truth, monkeypatch):
    """The figures of each variant, by name."""
    fed = {name: Fed(numbers) for name, numbers in variants().items()}
    extend, close = chain.Chain.extend, chain.Chain.close
    modules = (chain, closures, own_corners, pairwise)

    def each(what):
        for one in fed.values():
            for module in modules:
                module.TUNING = one.numbers
            what(one)

    def extended(self, *arguments):
        each(lambda one: one.extend(extend, *arguments))
        return extend(self, *arguments)

    def closed(self, *arguments):
        each(lambda one: close(one.chain, *arguments))
        return close(self, *arguments)

    with monkeypatch.context() as patch:
        for module in modules:
            patch.setattr(module, "TUNING", tuning.TUNING)
        patch.setattr(chain.Chain, "extend", extended)
        patch.setattr(chain.Chain, "close", closed)
        odometry = Odometry(camera)
        for frame in frames:
            odometry.process(frame)
    stages = odometry._stages
    return {name: one.figures(stages.map, stages.sensor, truth) for name, one in fed.items()}


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_the_numbers_of_the_chain_halved_and_doubled(shared_data, monkeypatch):
    recordings = {"arena": arena(seed=1, seconds=SECONDS)}
    for name in ("tum_fr1_xyz", "tum_fr1_rpy_part"):
        recording = read_recording(shared_data / name)
        recordings[name] = recording.camera, list(recording)[: 30 * SECONDS], recording.truth()["camera"]
    found = {name: swept(*each, monkeypatch) for name, each in recordings.items()}
    usual = {name: rows[AS_IT_IS] for name, rows in found.items()}
    print("\n", usual)
    assert not any(figures[4] for figures in usual.values())
    print("| number | ATE | closed chain: ATE | drift over 1 s | NEES of a link | holes |\n|---|---|---|---|---|---|")
    for variant in variants():
        ratios = {name: np.array(rows[variant][:4]) / usual[name][:4] for name, rows in found.items()}
        cells = [" / ".join(f"{ratios[name][k]:.2f}" for name in found) for k in range(4)]
        holes = sum(rows[variant][4] for rows in found.values())
        print(f"| {variant} | {' | '.join(cells)} | {holes} |")
