"""What is said about a camera that the kernel sees, from a folder laid out as the kernel's."""

import subprocess
import sys
from pathlib import Path

import pytest

from sensors.openni2.advice import cannot_open, no_device, usb_cameras


def plug(sysfs: Path, vendor: str, product: str, bus: int = 1, number: int = 6) -> None:
    folder = sysfs / f"{bus}-{number}"
    folder.mkdir(parents=True)
    for name, value in {"idVendor": vendor, "idProduct": product, "busnum": bus, "devnum": number}.items():
        (folder / name).write_text(f"{value}\n")


@pytest.mark.parametrize(
    ("vendor", "product", "expected"),
    [
        ("045e", "02ae", "libfreenect "),
        ("045e", "02c4", "libfreenect2"),
        ("1d27", "0601", "apt install libopenni2-0"),
        ("2bc5", "0401", "Orbbec"),
    ],
)
def test_a_camera_without_its_driver_says_which_one(tmp_path: Path, vendor: str, product: str, expected: str) -> None:
    plug(tmp_path, vendor, product)
    plug(tmp_path, "1d6b", "0002", number=1)
    cameras = usb_cameras(tmp_path, tmp_path / "dev")
    assert len(cameras) == 1
    assert expected in str(no_device("", [], cameras))


def test_a_forbidden_camera_says_the_udev_rule(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plug(tmp_path, "1d27", "0601")
    node = tmp_path / "dev" / "001" / "006"
    node.parent.mkdir(parents=True)
    node.touch(mode=0o400)
    monkeypatch.setattr("os.access", lambda path, mode: False)  # root may open anything
    cameras = usb_cameras(tmp_path, tmp_path / "dev")
    rule = 'SUBSYSTEM=="usb", ATTR{idVendor}=="1d27", ATTR{idProduct}=="0601", MODE="0666"'
    assert rule in str(no_device("", [], cameras))
    assert rule in str(cannot_open("1d27/0601@1/6", "Failed to open the USB device!", cameras))


def test_a_missing_library_says_the_apt_line(tmp_path: Path) -> None:
    program = (
        "import sys; from sensors.openni2 import library\n"
        "library.search_path = lambda: (__import__('pathlib').Path(sys.argv[1]),)\n"
        "try:\n library.load()\nexcept Exception as error: print(type(error).__name__, error)"
    )
    run = subprocess.run([sys.executable, "-c", program, str(tmp_path)], capture_output=True, text=True, check=True)
    assert "DeviceError" in run.stdout
    assert "apt install libopenni2-0" in run.stdout
