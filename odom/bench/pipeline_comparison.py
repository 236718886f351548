"""Compares a measurement of the pipeline with an earlier one of the same frames, before a change or elsewhere."""

from pathlib import Path

import numpy as np
from pydantic import TypeAdapter, ValidationError

from odom.bench.pipeline_bench import PipelineCost
from odom.errors import ConfigError
from odom.evaluation.paired_costs import BLOCK_FRAMES, FEWEST_BLOCKS, CostChange, cost_change


def read_cost(path: Path) -> PipelineCost:
    """Return what `odom bench pipeline --json` wrote to `path`.

    Raises ConfigError when the file can't be read or holds something else.
    """
    try:
        return TypeAdapter(PipelineCost).validate_json(path.read_bytes())
    except OSError as error:
        raise ConfigError(f"{path} can't be read: {error.strerror}") from error
    except ValidationError as error:
        raise ConfigError(
            f"{path} is not a file that this version's `odom bench pipeline SOURCE --json FILE` writes: measure it anew"
        ) from error


def compared(before: PipelineCost, now: PipelineCost) -> tuple[CostChange, ...]:
    """Compare the stages of both, over the frames of both (matched by stamps), in the order of `now`.

    Raises ConfigError when they share too few frames.
    """
    _, of_before, of_now = np.intersect1d(before.stamps_ns, now.stamps_ns, return_indices=True)
    if len(of_now) < BLOCK_FRAMES * FEWEST_BLOCKS:
        raise ConfigError(
            f"the two measurements share {len(of_now)} frames, {BLOCK_FRAMES * FEWEST_BLOCKS} are needed: "
            "measure the same part of the same source"
        )
    earlier = {stage.stage: np.asarray(stage.each_ms) for stage in before.stages}
    return tuple(
        cost_change(stage.stage, earlier[stage.stage][of_before], np.asarray(stage.each_ms)[of_now])
        for stage in now.stages
        if stage.stage in earlier
    )
