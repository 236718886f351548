"""Rerun's programs collect usage data unless their user has switched it off; those of this viewer never do."""

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory


@contextmanager
def without_usage_data() -> Iterator[dict[str, str]]:
    """Yield an environment in which they find what `rerun analytics disable` writes; the user's own stays as it is.

    They look for it in another folder of settings than usual, on Linux.
    """
    with TemporaryDirectory(prefix="odom-rerun-") as settings:
        file = Path(settings) / "rerun" / "analytics.json"
        file.parent.mkdir()
        places = {"config_file_path": str(file), "data_dir_path": str(file.parent)}
        file.write_text(json.dumps({"analytics_enabled": False, "analytics_id": "", "metadata": {}, **places}))
        yield os.environ | {"XDG_CONFIG_HOME": settings}
