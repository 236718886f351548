"""The job for one recording, named by a hash of everything that its results depend on."""

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import odom
from odom.batch.content_hashes import ContentHashes
from odom.batch.recordings import Recording
from odom.errors import ConfigError

_NUMERICS = ("numba", "numpy", "opencv-python-headless", "scipy")
"""Libraries by whose version the last bits of a result may change."""
_SOURCES = Path(odom.__file__).parents[1]


@dataclass(frozen=True)
class Job:
    """One recording with the `odom run` that is due: further `arguments`, and the `environment` of its settings.

    `content` is the hash of the recording, `program` that of the code (see `program_hash`), `key` that of everything.
    Results go to the folder `results / key`.
    """

    name: str
    path: Path
    content: str
    program: str
    key: str
    results: Path
    arguments: tuple[str, ...]
    environment: tuple[tuple[str, str], ...]

    @property
    def folder(self) -> Path:
        """Where the results are once they are whole."""
        return self.results / self.key

    @property
    def is_done(self) -> bool:
        """Whether the results are there: the folder gets this name when they are whole."""
        return self.folder.is_dir()


@cache
def program_hash() -> str:
    """Return the hash of this program's sources, its version and those of the libraries that compute."""
    state = hashlib.blake2b(odom.__version__.encode(), digest_size=16)
    for package in ("odom", "sensors"):
        for path in sorted((_SOURCES / package).rglob("*.py")):
            state.update(f"{path.relative_to(_SOURCES)}\0".encode() + path.read_bytes())
    for name in _NUMERICS:
        try:
            state.update(f"{name} {version(name)}\0".encode())
        except PackageNotFoundError:
            continue
    return state.hexdigest()


def plan_jobs(
    recordings: Iterable[Recording],
    hashes: ContentHashes,
    odometry: Mapping[str, Any],
    arguments: Iterable[tuple[str, Path | float | str]],
    results: Path,
) -> tuple[Job, ...]:
    """Return a job for each recording, run with the `odometry` settings and the options of `odom run` in `arguments`.

    A file among the arguments counts by its content. Raises SourceError when something cannot be read.
    """
    given = tuple(arguments)
    words = tuple(f"--{name}={value}" for name, value in given)
    meant = [(name, hashes.of(value) if isinstance(value, Path) else value) for name, value in given]
    environment = tuple((f"ODOM_ODOMETRY__{name.upper()}", json.dumps(value)) for name, value in odometry.items())
    program = program_hash()
    jobs = []
    for recording in recordings:
        content = hashes.of(recording.path)
        everything = {"recording": content, "program": program, "settings": dict(odometry), "arguments": meant}
        key = hashlib.blake2b(json.dumps(everything, sort_keys=True).encode(), digest_size=16).hexdigest()
        job = Job(recording.name, recording.path, content, program, key, results, words, environment)
        jobs.append(job)
    return tuple(jobs)


def shard_of(recordings: tuple[Recording, ...], shard: str | None) -> tuple[Recording, ...]:
    """Return the part `i/n` of the recordings, `i` from 0 to n - 1: every n-th one. None: all of them.

    Raises ConfigError for what is no such part.
    """
    if shard is None:
        return recordings
    index, _, count = shard.partition("/")
    if not (index.isdecimal() and count.isdecimal() and int(index) < int(count)):
        raise ConfigError(f"--shard {shard}: give i/n with i from 0 to n - 1, as in --shard 0/8")
    return recordings[int(index) :: int(count)]
