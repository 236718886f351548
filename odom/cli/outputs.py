"""Where recordings may be written, not onto what is read for them, and which files of figures can be."""

import json
import math
import time
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

from odom.errors import ConfigError, RecordingError, writing_to


def timed(output: Path) -> Path:
    """Return the path with `{time}` replaced by the present one (UTC), as in 20260131T235959Z."""
    return Path(str(output).replace("{time}", time.strftime("%Y%m%dT%H%M%SZ", time.gmtime())))


def check_recording_name(output: Path) -> None:
    """Raise ConfigError when no command would know `output` as a recording by its name."""
    if output.suffix.lower() != ".mcap":
        raise ConfigError(f"{output}: give a name that ends with .mcap, by which a recording is known")


def check_not_read(source: str, output: Path) -> None:
    """Raise ConfigError when `output` is the recording SOURCE, or lies in the folder that is read."""
    read = Path(source.removeprefix("kinect:"))
    if not (output.exists() and read.exists()):
        return
    if output.resolve().is_relative_to(read.resolve()) if read.is_dir() else output.samefile(read):
        raise ConfigError(f"{output} is what would be read: give another name for the recording")


def check_recording(source: str, output: Path, overwrite: bool, out: Path | None, map_: Path | None) -> None:
    """Raise ConfigError when `odom run SOURCE` may not record to `output`, whose name may hold `{time}`.

    It may not where the run itself writes: the folder `out` and its results, and the map.
    """
    from odom.service.previous_results import is_result
    from odom.wire.recording.part_file import check_free

    check_not_read(source, output)
    written, folder = output.resolve(), None if out is None else out.resolve()
    is_folder = folder is not None and folder.is_relative_to(written)
    if is_folder or (written.parent == folder and is_result(written.name)) or (map_ and written == map_.resolve()):
        raise ConfigError(f"--record {output} is what the run itself writes: give another name for the recording")
    check_recording_name(output)
    try:
        check_free(output, overwrite)
    except RecordingError as error:
        raise ConfigError(f"--record: {error}") from error
    check_place("--record", output)


def check_files(json_file: Path | None, picture: Path | None = None, table: Path | None = None) -> None:
    """Raise ConfigError when --json, --plot or --markdown asks for what cannot be: before the work, else lost."""
    for option, path in (("--json", json_file), ("--plot", picture), ("--markdown", table)):
        if path is None:
            continue
        if path.is_dir():
            raise ConfigError(f"{option} {path} is a folder: give the name of a file in it")
        check_place(option, path)
    if picture is not None and picture.suffix:
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        if picture.suffix[1:].lower() not in FigureCanvasAgg.get_supported_filetypes():
            raise ConfigError(f"--plot {picture}: {picture.suffix} is no kind of picture: let it end with .png or .pdf")


def check_place(option: str, output: Path) -> None:
    """Raise ConfigError where no file or folder `output` can be made, nor the folders above it; none is made."""
    folder = next(parent for parent in output.absolute().parents if parent.exists())
    try:
        TemporaryFile(dir=folder).close()
    except OSError as error:
        raise ConfigError(f"{option} {output}: nothing can be written in {folder}; give another place") from error


def write_json(path: Path, content: Any, indent: int | None = None) -> None:
    """Write figures as JSON, null for one that is not finite: JSON has no NaN, and other programs refuse it.

    Raises OdomError when the file cannot be written.
    """
    with writing_to(path):
        path.write_text(json.dumps(_finite(content), indent=indent, allow_nan=False) + "\n")


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
