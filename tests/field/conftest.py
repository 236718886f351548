"""The virtual Kinect: a driver compiled here and loaded by the real libOpenNI2 from a private folder."""

import shutil
import subprocess
import sysconfig
from collections.abc import Iterator
from pathlib import Path

import pytest
from playing import kinect_driver, rendered, rig, vga_rig
from virtual_kinect.device import Kinects

__all__ = ["kinect_driver", "rendered", "rig", "vga_rig"]

DRIVER = Path(__file__).parent / "virtual_kinect" / "virtual_kinect.cpp"
HEADERS = Path("/usr/include/openni2")


def _debian_libraries() -> Path:
    return Path(f"/usr/lib/{sysconfig.get_config_var('MULTIARCH')}")


@pytest.fixture(scope="session")
def openni2_redist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A private folder with the real libOpenNI2, its .oni driver and the virtual driver."""
    library = _debian_libraries() / "libOpenNI2.so.0"
    compiler = shutil.which("g++")
    if not (library.exists() and HEADERS.is_dir() and compiler):
        pytest.skip("needs the real OpenNI2 and a compiler: apt install libopenni2-0 libopenni2-dev g++")
    folder = tmp_path_factory.mktemp("openni2")
    drivers = folder / "OpenNI2" / "Drivers"
    drivers.mkdir(parents=True)
    (folder / "libOpenNI2.so").symlink_to(library)
    (drivers / "libOniFile.so.0").symlink_to(_debian_libraries() / "OpenNI2" / "Drivers" / "libOniFile.so.0")
    flags = ["-std=c++17", "-O2", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC", "-isystem", HEADERS]
    subprocess.run([compiler, *flags, "-o", drivers / "libVirtualKinect.so.0", DRIVER], check=True)
    return folder


@pytest.fixture
def kinects(openni2_redist: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Kinects]:
    """Plug in virtual Kinects: `kinects("a", serial="A1", ...)`; the library is loaded with them afterwards."""
    root = tmp_path / "kinects"
    root.mkdir()
    monkeypatch.setenv("OPENNI2_REDIST64", str(openni2_redist))
    monkeypatch.setenv("VIRTUAL_KINECT", str(root))
    yield Kinects(root)
    # The library can be loaded once a process: its devices belong to this test.
    from sensors.openni2 import library

    library.load().unload()
