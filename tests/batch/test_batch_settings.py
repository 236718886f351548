"""Every setting that changes a run's results reaches the runs of a batch, and counts among what names them."""

from contextlib import suppress
from pathlib import Path

import cv2
import numpy as np
import pytest
from refused import process_as_it_was

from odom.batch.job import Job
from odom.cli.batch import batch
from odom.errors import ConfigError


class OnlyPlannedError(Exception):
    """Ends a batch before anything runs."""


@pytest.fixture
def planned(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Return a function that gives the job that a batch of one recording would run, by the settings in a file."""
    (tmp_path / "walk.mcap").write_text("a recording")

    def plan(config: Path | None = None) -> Job:
        due: list[Job] = []

        def note(jobs: list[Job], *_: object) -> None:
            due.extend(jobs)
            raise OnlyPlannedError

        monkeypatch.setattr("odom.batch.fleet.run_here", note)
        with process_as_it_was(), suppress(OnlyPlannedError):
            batch([tmp_path / "walk.mcap"], tmp_path / "out", jobs=1, config=config)
        return due[0]

    return plan


def write_mask(file: Path, width: int) -> Path:
    image = np.zeros((48, 64), dtype=np.uint8)
    image[:, :width] = 255
    cv2.imwrite(str(file), image)
    return file


def test_a_mask_among_the_settings_counts_by_its_content(tmp_path, planned):
    mask, config = write_mask(tmp_path / "mask.png", 10), tmp_path / "odom.yaml"
    config.write_text(f"service: {{mask: {mask}}}")
    with_mask, without = planned(config), planned()
    assert with_mask.arguments == (f"--mask={mask}",)
    assert without.arguments == ()
    write_mask(mask, 20)
    assert len({with_mask.key, without.key, planned(config).key}) == 3


def test_a_mask_in_the_environment_counts(tmp_path, planned, monkeypatch):
    without = planned()
    monkeypatch.setenv("ODOM_SERVICE__MASK", str(write_mask(tmp_path / "mask.png", 10)))
    assert planned().key != without.key


def test_a_mask_that_is_missing_is_refused_before_anything_runs(tmp_path, planned):
    config = tmp_path / "odom.yaml"
    config.write_text(f"service: {{mask: {tmp_path / 'none.png'}}}")
    with pytest.raises(ConfigError, match=r"none\.png"):
        planned(config)


def test_periods_of_messages_make_nothing_due(tmp_path, planned):
    config = tmp_path / "odom.yaml"
    config.write_text("service: {status_period_s: 0.5}")
    assert planned(config).key == planned().key
