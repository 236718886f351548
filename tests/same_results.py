"""Show that a change leaves the results as they were: `python tests/same_results.py REVISION [SOURCE ...]`.

Runs `odom run` of a git revision and of the working tree on the same sources and compares trajectory.txt and
odometry.txt byte by byte. Exit status 1 where any differ. Without sources it takes TUM's fr1_xyz, the first part of
fr1_rpy (where ODOM_SHARED_DATA or ../shared/data has them) and recordings/arena.mcap.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

PROJECT = Path(__file__).parents[1]
FILES = ("trajectory.txt", "odometry.txt")


def default_sources() -> list[Path]:
    shared = Path(os.environ.get("ODOM_SHARED_DATA", PROJECT.parent / "shared" / "data"))
    recorded = [shared / "tum_fr1_xyz", shared / "tum_fr1_rpy_part"]
    return [source for source in recorded if source.is_dir()] + [PROJECT / "recordings" / "arena.mcap"]


def run(project: Path, source: Path, out: Path) -> None:
    command = [sys.executable, "-m", "odom", "run", str(source.resolve()), "--headless", "--out", str(out)]
    environment = os.environ | {"PYTHONPATH": str(project)}
    subprocess.run(command, cwd=project, env=environment, check=True, stdout=subprocess.DEVNULL)


def main(revision: str, *sources: str) -> int:
    differing = 0
    with tempfile.TemporaryDirectory() as temporary:
        before = Path(temporary) / "before"
        subprocess.run(["git", "worktree", "add", "--detach", str(before), revision], cwd=PROJECT, check=True)
        try:
            for source in [Path(s) for s in sources] or default_sources():
                old, new = Path(temporary) / "old" / source.name, Path(temporary) / "new" / source.name
                run(before, source, old)
                run(PROJECT, source, new)
                for name in FILES:
                    is_equal = (old / name).read_bytes() == (new / name).read_bytes()
                    differing += not is_equal
                    print(f"{source.name} {name}: {'equal' if is_equal else 'DIFFERENT'}", flush=True)
        finally:
            subprocess.run(["git", "worktree", "remove", "--force", str(before)], cwd=PROJECT, check=True)
    return 1 if differing else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
