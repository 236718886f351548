"""`python -m odom`: the `odom` command of this very interpreter."""

import sys


def main() -> None:
    """Run the command line; Ctrl-C that comes before a command can end cleanly ends it at once, with status 130."""
    try:
        from odom.cli import main as run

        run()
    except KeyboardInterrupt:
        sys.exit(130)


if __name__ == "__main__":
    main()
