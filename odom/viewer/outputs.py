"""Where the viewer shows: a file, a web page, a window; the last two read from one server in this process."""

import os
import socket
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

import rerun as rr

from odom.errors import ConfigError, OdomError
from odom.viewer.blueprint import blueprint
from odom.viewer.rerun_program import RerunProgram, running, this_process_listens
from odom.viewer.settings import ViewerSettings
from odom.viewer.written_file import make, told_if_not_whole

APPLICATION = "rgbd-odom"
_FLUSH_S = 0.1
"""Between two parcels to Rerun: longer is seen as lag, shorter costs CPU for each."""
_LAST_FLUSH_S = 10.0
"""At the end, for what waits to reach the file: a slow disk needs seconds, a hung one is not waited for."""


@dataclass(frozen=True)
class Outputs:
    """The outputs asked for; a desktop window and a web page are both clients of the server.

    With `overwrite` the file may replace one of its name.
    """

    web: bool = False
    desktop: bool = False
    file: Path | None = None
    overwrite: bool = False

    @property
    def served(self) -> bool:
        """Whether anybody may look while it runs."""
        return self.web or self.desktop


def choose(web: bool, headless: bool, file: Path | None, overwrite: bool = False) -> Outputs:
    """Return the outputs of the options: without any, a window where there is a screen, else a web page.

    Raises ConfigError when nothing would be shown or written.
    """
    if headless and web:
        raise ConfigError("--headless and --web contradict each other: give one of them")
    if headless and file is None:
        raise ConfigError("--headless without --rrd FILE shows nothing: leave it out or name a file")
    desktop = not (web or headless or file is not None) and has_screen()
    return Outputs(web or not (desktop or headless or file is not None), desktop, file, overwrite)


def has_screen() -> bool:
    """Return whether a window can be opened here."""
    return sys.platform in ("win32", "darwin") or any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))


@dataclass(frozen=True)
class OpenOutputs:
    """An open recording, the address of its web page, and Rerun's programs that show it."""

    recording: rr.RecordingStream
    address: str | None
    programs: tuple[RerunProgram, ...]

    @property
    def closed(self) -> bool:
        """Whether the window has been closed by its user; raises OdomError when it, or the page, failed."""
        return any(program.has_ended for program in self.programs)


@contextmanager
def open_outputs(outputs: Outputs, settings: ViewerSettings, name: str) -> Iterator[OpenOutputs]:
    """Open a recording named `name` into the outputs and close all at the end, the file complete.

    Raises OdomError when the file cannot be written whole or no port is free, ConfigError when it may not be replaced.
    """
    with ExitStack() as stack:
        recording = rr.RecordingStream(APPLICATION, batcher_config=_batching())
        stack.callback(recording.disconnect)
        if outputs.file is not None:
            make(outputs.file, outputs.overwrite)
        with told_if_not_whole(outputs.file):
            opened = _open_sinks(recording, outputs, settings, stack)
        recording.send_recording_name(name)
        yield opened
        with told_if_not_whole(outputs.file):
            recording.flush(timeout_sec=_LAST_FLUSH_S)


def _open_sinks(
    recording: rr.RecordingStream, outputs: Outputs, settings: ViewerSettings, stack: ExitStack
) -> OpenOutputs:
    """Open file and server, and start what shows the server's data, to be ended by `stack`.

    Another viewer may take a port between its choice and its use, which Rerun only logs: then other ports are tried.
    Raises OdomError when none can be used.
    """
    files = [] if outputs.file is None else [rr.FileSink(outputs.file)]
    if not outputs.served:
        recording.set_sinks(*files, default_blueprint=blueprint())
        return OpenOutputs(recording, None, ())
    reason = "other programs took each port meanwhile"
    for preferred in (settings.data_port, 0, 0):
        data_port = free_port(settings.host, preferred)
        web_port = free_port(settings.host, settings.web_port, taken=data_port)
        server = rr.GrpcServerSink(
            settings.host,
            data_port,
            server_memory_limit=f"{settings.server_memory_mib}MiB",
            newest_first=True,
            cors_allow_origin=[f"http://{_origin(settings.host)}:{web_port}"],
        )
        recording.set_sinks(*files, server, default_blueprint=blueprint())
        if not this_process_listens(data_port):
            continue
        data = f"rerun+http://{_reachable(settings.host)}:{data_port}/proxy"
        address, programs = None, []
        if outputs.web:
            arguments = ["--serve-web", "--bind", settings.host, "--web-viewer-port", str(web_port), data]
            programs.append(stack.enter_context(running("web page", "start the viewer again", arguments)))
            if not programs[0].comes_to_listen(web_port):
                reason = programs[0].last_line
                continue
            address = f"http://{_reachable(settings.host)}:{web_port}/?url={quote(data, safe=':/')}"
        if outputs.desktop:
            limit = f"{settings.desktop_memory_mib}MiB"
            arguments = ["--connect", data, "--bind", "127.0.0.1", "--memory-limit", limit, "--hide-welcome-screen"]
            programs.append(stack.enter_context(running("window", "--web shows it in a browser", arguments)))
        return OpenOutputs(recording, address, tuple(programs))
    raise OdomError(f"cannot serve on {settings.host}: {reason}; start the viewer again")


def free_port(host: str, preferred: int, taken: int | None = None) -> int:
    """Return `preferred`, or a port that is free on `host` when somebody has it already.

    Raises OdomError when the address cannot be listened on at all.
    """
    for port in (preferred, 0):
        if port and port == taken:
            continue
        with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind((host, port))
                return int(probe.getsockname()[1])
            except OSError as error:
                reason = error
    raise OdomError(f"cannot listen on {host}: {reason}; give another --host")


def _batching() -> rr.ChunkBatcherConfig:
    config = rr.ChunkBatcherConfig.DEFAULT()
    config.flush_tick = _FLUSH_S
    return config


def _reachable(host: str) -> str:
    return socket.gethostname() if host in ("0.0.0.0", "::") else f"[{host}]" if ":" in host else host


def _origin(host: str) -> str:
    return "*" if host in ("0.0.0.0", "::") else _reachable(host)
