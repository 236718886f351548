"""Where the viewer shows: a file, a web page, a window; the last two read from one server in this process."""

import ctypes
import logging
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO
from urllib.parse import quote

import psutil
import rerun as rr

from odom.errors import ConfigError, OdomError
from odom.viewer.blueprint import blueprint
from odom.viewer.settings import ViewerSettings
from odom.viewer.usage_data import without_usage_data
from odom.viewer.written_file import make, told_if_not_whole

_LOG = logging.getLogger(__name__)
APPLICATION = "rgbd-odom"
_FLUSH_S = 0.1
"""Between two parcels to Rerun: longer is seen as lag, shorter costs CPU for each."""
_LISTEN_S = 2.0
"""For the server to listen on its port, which it does at once; then the port counts as taken."""
_LISTEN_POLL_S = 0.02
"""Between two looks whether it does."""
_LAST_FLUSH_S = 10.0
"""At the end, for what waits to reach the file: a slow disk needs seconds, a hung one is not waited for."""
_END_S = 5.0
"""For Rerun's own programs to end when asked, before they are killed."""
_SET_PARENT_DEATH_SIGNAL = 1
"""PR_SET_PDEATHSIG of prctl(2)."""


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
    """An open recording, the address of its web page, and the window that shows it with its error output."""

    recording: rr.RecordingStream
    address: str | None
    window: subprocess.Popen[bytes] | None
    errors: IO[bytes] | None = None

    @property
    def window_closed(self) -> bool:
        """Whether the window has been closed by its user; raises OdomError when it could not be shown."""
        status = None if self.window is None else self.window.poll()
        if status is not None and status > 0:
            raise OdomError(
                f"Rerun's window ended with status {status}: {_last_line(self.errors)}; --web shows it in a browser"
            )
        return status is not None


def _last_line(errors: IO[bytes] | None) -> str:
    if errors is None:
        return "it does not say why"
    errors.seek(0)
    return (errors.read().decode(errors="replace").strip().splitlines() or ["it does not say why"])[-1]


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
            data_port, web_port = _open_sinks(recording, outputs, settings)
        recording.send_recording_name(name)
        data = f"rerun+http://{_reachable(settings.host)}:{data_port}/proxy"
        address = window = errors = None
        if outputs.web:
            stack.enter_context(
                _child(["--serve-web", "--bind", settings.host, "--web-viewer-port", str(web_port), data])
            )
            address = f"http://{_reachable(settings.host)}:{web_port}/?url={quote(data, safe=':/')}"
        if outputs.desktop:
            limit = f"{settings.desktop_memory_mib}MiB"
            arguments = ["--connect", data, "--bind", "127.0.0.1", "--memory-limit", limit, "--hide-welcome-screen"]
            errors = stack.enter_context(TemporaryFile())
            window = stack.enter_context(_child(arguments, errors))
        yield OpenOutputs(recording, address, window, errors)
        with told_if_not_whole(outputs.file):
            recording.flush(timeout_sec=_LAST_FLUSH_S)


def _open_sinks(recording: rr.RecordingStream, outputs: Outputs, settings: ViewerSettings) -> tuple[int, int]:
    """Open file and server, and return the ports of the data and of the page (0: not served).

    Another viewer may take a port between its choice and the server's use of it, which Rerun only logs: then another
    port is tried. Raises OdomError when none can be used.
    """
    files = [] if outputs.file is None else [rr.FileSink(outputs.file)]
    if not outputs.served:
        recording.set_sinks(*files, default_blueprint=blueprint())
        return 0, 0
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
        if _is_listening(data_port):
            return data_port, web_port
    raise OdomError(f"cannot serve on {settings.host}: every port was taken meanwhile; try again")


def _is_listening(port: int) -> bool:
    """Return whether this process listens on the port, or does so soon."""
    deadline = time.monotonic() + _LISTEN_S
    while time.monotonic() < deadline:
        connections = psutil.Process().net_connections("tcp")
        if any(c.status == psutil.CONN_LISTEN and c.laddr.port == port for c in connections):
            return True
        time.sleep(_LISTEN_POLL_S)
    return False


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


@contextmanager
def _child(arguments: Sequence[str], errors: IO[bytes] | None = None) -> Iterator[subprocess.Popen[bytes]]:
    with without_usage_data() as environment:
        process = subprocess.Popen(
            [str(_program()), *arguments],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL if errors is None else errors,
            env=environment,
            preexec_fn=_end_with_parent if sys.platform == "linux" else None,
        )
        try:
            yield process
        finally:
            process.terminate()
            try:
                process.wait(_END_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def _program() -> Path:
    package = find_spec("rerun_cli")
    if package is None or package.origin is None:
        raise OdomError("Rerun's program is missing: reinstall rerun-sdk")
    return Path(package.origin).with_name("rerun.exe" if sys.platform == "win32" else "rerun")


def _end_with_parent() -> None:
    """Let Linux end the child with its parent, even by kill -9: it would keep the port otherwise."""
    ctypes.CDLL(None).prctl(_SET_PARENT_DEATH_SIGNAL, signal.SIGTERM)
