"""Which files of a folder are the parts of a ROS 2 bag."""

import re
from dataclasses import dataclass
from pathlib import Path

import yaml

from odom.errors import RecordingError

METADATA, DATABASE_SUFFIX = "metadata.yaml", ".db3"
_MCAP_SUFFIX, _PACKED_SUFFIX = ".mcap", ".zstd"
UNPACK_FIRST = "is compressed as a whole: give its folder, with the metadata.yaml, or unpack it with: zstd -d FILE"
"""What is to be done with a file of a bag that cannot be read by itself."""


@dataclass(frozen=True)
class BagFolder:
    """The `files` of a bag in the order of their numbers.

    `is_described` says that there is a metadata.yaml, `is_compressed` that by it files or messages are compressed.
    """

    files: list[Path]
    is_described: bool
    is_compressed: bool

    @property
    def recordings(self) -> list[Path]:
        """Its .mcap files."""
        return [file for file in self.files if file.suffix == _MCAP_SUFFIX]

    @property
    def databases(self) -> list[Path]:
        """Its .db3 files."""
        return [file for file in self.files if file.suffix == DATABASE_SUFFIX]


def bag_folder(path: Path) -> BagFolder:
    """Return the files of a bag that metadata.yaml lists and that are there, else all of a folder but hidden ones.

    Raises RecordingError where there are none, or only such as must be unpacked first.
    """
    listed, is_compressed = _described(path / METADATA)
    parts = [file for file in sorted(path.iterdir(), key=_number) if _is_part(file) and not file.name.startswith(".")]
    bag = BagFolder(
        [file for file in parts if file.name in listed] or parts, (path / METADATA).is_file(), is_compressed
    )
    if not parts:
        raise RecordingError(f"{path} is no ROS 2 bag: neither .mcap nor .db3 files are in it")
    if not is_compressed and all(map(is_packed, bag.files)):
        raise RecordingError(f"{bag.files[0]} {UNPACK_FIRST}")
    return bag


def _is_part(file: Path) -> bool:
    return file.suffix in (_MCAP_SUFFIX, DATABASE_SUFFIX) or is_packed(file)


def is_packed(file: Path) -> bool:
    """Return whether a file is by its name a part of a bag that was compressed as a whole."""
    return file.suffix == _PACKED_SUFFIX and Path(file.stem).suffix in (_MCAP_SUFFIX, DATABASE_SUFFIX)


def _described(metadata: Path) -> tuple[set[str], bool]:
    """Return the names of the files that a metadata.yaml lists, and whether it names a compression."""
    try:
        bag = yaml.safe_load(metadata.read_bytes())["rosbag2_bagfile_information"]
        return {Path(name).name for name in bag["relative_file_paths"]}, bool(bag.get("compression_mode"))
    except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError, yaml.YAMLError):
        return set(), False


def _number(part: Path) -> tuple[int, str]:
    """Return a sort key that puts `bag_10` behind `bag_9`."""
    digits = re.search(r"\d+\Z", Path(part.stem).stem if is_packed(part) else part.stem)
    return (int(digits[0]) if digits else 0, part.name)
