"""The `odom` command. One module a command; heavy packages are imported inside the commands."""

import atexit
import gc
import logging
import os
import sys
from pathlib import Path
from typing import Annotated

import typer

import odom
from odom.cli import logs
from odom.cli.batch import batch
from odom.cli.bench import bench
from odom.cli.calibrate import calibrate
from odom.cli.config import config
from odom.cli.doctor import doctor
from odom.cli.eval import evaluate
from odom.cli.export import export
from odom.cli.import_ import import_
from odom.cli.info import info
from odom.cli.json_lines import wrap_stderr
from odom.cli.keys import keys
from odom.cli.map import map_
from odom.cli.mask import mask
from odom.cli.optional_domain import WithRos2Domain
from odom.cli.record import record
from odom.cli.recover import recover
from odom.cli.ros2 import ros2
from odom.cli.router import router
from odom.cli.run import run
from odom.cli.sensor import sensor
from odom.cli.serve import serve
from odom.cli.streams import outlive_readers
from odom.cli.view import view
from odom.errors import ConfigError, OdomError
from odom.service.log_form import JSON_ENVIRONMENT, as_json
from odom.service.parent_watch import end_with_parent
from odom.service.settings_errors import names, nearest, stray_variables, variable

app = typer.Typer(
    help="RGB-D odometry as a streaming service.",
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
)
app.command("run", cls=WithRos2Domain)(run)
app.command("serve", cls=WithRos2Domain)(serve)
app.command("view")(view)
app.command("config")(config)
app.command("eval")(evaluate)
app.command("doctor")(doctor)
app.command("calibrate")(calibrate)
app.command("mask")(mask)
app.command("sensor", cls=WithRos2Domain)(sensor)
app.command("record")(record)
app.command("import")(import_)
app.command("batch")(batch)
app.command("export")(export)
app.command("recover")(recover)
app.command("info")(info)
app.command("router")(router)
app.command("ros2")(ros2)
app.command("keys")(keys)
app.add_typer(map_, name="map")
app.add_typer(bench, name="bench")

_YOUNG_OBJECTS = 10_000
"""New objects before the interpreter looks for garbage: its own 700 take a tenth of the time of a start, with all that
is imported; many more would only leave cycles lying about for longer."""
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
"""Variables that keep numerical libraries to one thread a process: those of several processes only take turns."""


def _print_version(is_asked: bool) -> None:
    if is_asked:
        typer.echo(f"odom {odom.__version__}")
        raise typer.Exit


def _tell_stray_variables() -> None:
    """Warn of variables that begin like settings and are none; the children of `odom run` have its environment."""
    stray = stray_variables(os.environ)
    if not stray:
        return
    from odom.service.progress import is_in_a_run
    from odom.service.settings import Settings

    if is_in_a_run():
        return
    known = [variable(name) for name in names(Settings)]
    for name in stray:
        words = "%s is no setting and has no effect%s; see `odom config`"
        logging.getLogger(__name__).warning(words, name, nearest(name.upper(), known))


@app.callback()
def root(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and end.")
    ] = False,
    log_json: Annotated[
        bool, typer.Option("--log-json", envvar=JSON_ENVIRONMENT, help="Log one JSON object a line.")
    ] = False,
    log_level: Annotated[
        logs.Level, typer.Option(envvar=logs.LEVEL_ENVIRONMENT, help="Log lines of this level and above.")
    ] = logs.Level.INFO,
    tls: Annotated[
        tuple[Path, Path, Path] | None,
        typer.Option(metavar="CERT KEY CA", help="Encrypt, and check both sides (see keys)."),
    ] = None,
    user: Annotated[str | None, typer.Option(help="User name to present.")] = None,
    password_file: Annotated[Path | None, typer.Option(help="File with the user's password in its first line.")] = None,
) -> None:
    """RGB-D odometry as a streaming service."""
    logs.configure(log_level, log_json)
    _tell_stray_variables()
    certificate, key, ca = tls or (None, None, None)
    given = {"CERTIFICATE": certificate, "KEY": key, "CA": ca, "USER": user, "PASSWORD_FILE": password_file}
    # As settings, so that the processes that `odom run` starts have them too.
    os.environ.update(
        {f"ODOM_WIRE__SECURITY__{name}": str(value) for name, value in given.items() if value is not None}
    )


def main() -> None:
    """Run the command line: exit status 0 done, 1 ran but failed, 2 called wrongly."""
    gc.set_threshold(_YOUNG_OBJECTS)
    outlive_readers()
    if logs.is_json_asked(sys.argv):
        app.rich_markup_mode = None  # a box around an error is none in a log
        logs.lead_to(wrap_stderr())
        logs.configure(logs.Level.INFO, as_json=True)
    for name in ONE_THREAD:
        os.environ.setdefault(name, "1")
    end_with_parent()
    atexit.register(gc.freeze)  # else the interpreter looks through all it has loaded, for seconds on a busy machine
    try:
        app(prog_name="odom")
    except ConfigError as error:
        _tell(error)
        sys.exit(2)
    except (OdomError, OSError) as error:
        logging.getLogger(__name__).debug("where it happened", exc_info=True)
        _tell(error)
        sys.exit(1)


def _tell(error: Exception) -> None:
    if as_json():
        logging.getLogger("odom").error("%s", error)
    else:
        print(f"odom: {error}", file=sys.stderr)
