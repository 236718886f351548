"""Finds, loads and restarts the real libOpenNI2 and lists its devices."""

import os
import sysconfig
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from odom.errors import DeviceError
from sensors.openni2 import advice

NAMES = ("libOpenNI2.so", "libOpenNI2.so.0")
"""The first comes with Debian's -dev package or a vendor's folder, the second with the plain package."""


@dataclass(frozen=True)
class Listed:
    """A device as OpenNI2 lists it."""

    uri: str
    vendor: str
    name: str

    def __str__(self) -> str:
        return f"{self.uri} ({self.vendor} {self.name})"


def search_path() -> tuple[Path, ...]:
    """Return the folders in which libOpenNI2 is looked for, the vendor's own variables first."""
    folders = [os.environ.get(name, "") for name in ("OPENNI2_REDIST64", "OPENNI2_REDIST")]
    multiarch = sysconfig.get_config_var("MULTIARCH")
    folders += [f"/usr/lib/{multiarch}"] if multiarch else []
    return tuple(Path(folder) for folder in [*folders, "/usr/local/lib", "/usr/lib64", "/usr/lib"] if folder)


def load() -> ModuleType:
    """Return the `openni.openni2` module with the library loaded and initialised; once for each process.

    Raises DeviceError, with what to install, when the Python package or the library is missing or has no drivers.
    """
    try:
        from openni import _openni2 as c_api
        from openni import openni2
    except ImportError as error:
        raise DeviceError("the Python package openni is missing: pip install 'rgbd-odom[kinect]'") from error
    module: ModuleType = openni2
    if openni2.is_initialized():
        return module
    if openni2.loaded_dll_directory is None:
        files = [folder / name for folder in search_path() for name in NAMES]
        library = next((file for file in files if file.is_file()), None)
        if library is None:
            raise advice.no_library(search_path())
        try:
            c_api.load_dll(str(library))
        except (OSError, AttributeError) as error:
            raise DeviceError(f"{library} cannot be loaded ({error}): apt install --reinstall libopenni2-0") from error
        openni2.loaded_dll_directory = str(library.parent)
    try:
        openni2.initialize()
    except openni2.OpenNIError as error:
        raise DeviceError(
            f"OpenNI2 in {openni2.loaded_dll_directory} finds no drivers ({said(error)}): "
            "its folder OpenNI2/Drivers must hold them"
        ) from error
    return module


def restart() -> ModuleType:
    """Shut the library down and start it again: some drivers list devices only then. No handle may be open.

    It never returns when a driver reports a device at that moment, see `presence.Listing`.
    """
    load().unload()
    return load()


def open_device(uri: str) -> Any:
    """Return the package's Device at `uri`, opened; raises its OpenNIError.

    The package would close a device that failed to open; the library then counts one opening too few, and takes the
    next attempt for a second user of a device that it never opened.
    """
    api = load()
    device = api.Device.__new__(api.Device)
    try:
        device.__init__(uri.encode())
    except api.OpenNIError:
        device._handle = None
        raise
    return device


def devices() -> tuple[Listed, ...]:
    """Return what OpenNI2 lists, in its order."""
    import ctypes

    from openni import _openni2 as c_api

    load()
    infos = ctypes.POINTER(c_api.OniDeviceInfo)()
    count = ctypes.c_int()
    c_api.oniGetDeviceList(ctypes.byref(infos), ctypes.byref(count))
    try:
        texts = [(info.uri, info.vendor, info.name) for info in infos[: count.value]]
        return tuple(Listed(*(text.decode(errors="replace") for text in device)) for device in texts)
    finally:
        c_api.oniReleaseDeviceList(infos)


def said(error: Exception) -> str:
    """Return OpenNI2's own words for an error, in one line."""
    parts = [part.decode(errors="replace") if isinstance(part, bytes) else str(part) for part in error.args]
    return " ".join(" ".join(parts).split())
