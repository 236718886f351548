"""The `odom` command. One module a command; heavy packages are imported inside the commands."""

import sys

import typer

from odom.cli.eval import evaluate
from odom.errors import ConfigError, OdomError

app = typer.Typer(
    help="RGB-D odometry as a streaming service.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
app.command("eval")(evaluate)


@app.callback()
def root() -> None:
    """RGB-D odometry as a streaming service."""


def main() -> None:
    """Run the command line: exit status 0 done, 1 ran but failed, 2 called wrongly."""
    try:
        app()
    except ConfigError as error:
        print(f"odom: {error}", file=sys.stderr)
        sys.exit(2)
    except OdomError as error:
        print(f"odom: {error}", file=sys.stderr)
        sys.exit(1)
