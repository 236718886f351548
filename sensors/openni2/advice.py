"""What to do when an OpenNI2 device or library does not work: names the cause and the remedy."""

import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from odom.errors import DeviceError

SYSFS = Path("/sys/bus/usb/devices")
DEVFS = Path("/dev/bus/usb")

_OPENNI2 = "apt install libopenni2-0"
_LIBFREENECT = (
    "build libfreenect with -DBUILD_OPENNI2_DRIVER=ON and put libFreenectDriver.so into the folder OpenNI2/Drivers "
    "beside libOpenNI2 (Debian's library loads names that end in .so.0)"
)
_LIBFREENECT2 = (
    "build libfreenect2 with -DBUILD_OPENNI2_DRIVER=ON and put libfreenect2-openni2.so into the folder OpenNI2/Drivers "
    "beside libOpenNI2 (Debian's library loads names that end in .so.0); it needs USB 3"
)
_ORBBEC = "install Orbbec's OpenNI2 and set OPENNI2_REDIST64 to its folder"

CAMERAS = {
    ("045e", "02ae"): ("Kinect for Xbox 360 (v1)", _LIBFREENECT),
    ("045e", "02bf"): ("Kinect for Windows (v1)", _LIBFREENECT),
    ("045e", "02c4"): ("Kinect v2", _LIBFREENECT2),
    ("045e", "02d8"): ("Kinect v2", _LIBFREENECT2),
    ("1d27", None): ("PrimeSense camera (Xtion, Carmine, Structure)", _OPENNI2),
    ("2bc5", None): ("Orbbec camera", _ORBBEC),
}
"""USB vendor and product (None: any) of the cameras that OpenNI2 has drivers for, and where the driver comes from."""


@dataclass(frozen=True)
class UsbCamera:
    """A depth camera that the kernel sees, whether or not OpenNI2 does; `node` is its device file."""

    name: str
    vendor: str
    product: str
    node: Path
    driver: str

    @property
    def permitted(self) -> bool:
        """Whether this user may open it."""
        return not self.node.exists() or os.access(self.node, os.R_OK | os.W_OK)

    @property
    def rule(self) -> str:
        """The udev rule that would permit it."""
        return f'SUBSYSTEM=="usb", ATTR{{idVendor}}=="{self.vendor}", ATTR{{idProduct}}=="{self.product}", MODE="0666"'


def usb_cameras(sysfs: Path = SYSFS, devfs: Path = DEVFS) -> tuple[UsbCamera, ...]:
    """Return the depth cameras plugged into this machine, as the kernel lists them."""
    found = []
    for folder in sorted(sysfs.glob("*")):
        values = [_read(folder / name) for name in ("idVendor", "idProduct", "busnum", "devnum")]
        vendor, product, bus, number = values
        known = CAMERAS.get((vendor, product)) or CAMERAS.get((vendor, None))
        if known and bus.isdigit() and number.isdigit():
            node = devfs / f"{int(bus):03d}" / f"{int(number):03d}"
            found.append(UsbCamera(known[0], vendor, product, node, known[1]))
    return tuple(found)


def _read(file: Path) -> str:
    try:
        return file.read_text().strip()
    except OSError:
        return ""


def no_library(looked_in: Iterable[Path]) -> DeviceError:
    """Return the error for a missing libOpenNI2."""
    places = ", ".join(str(folder) for folder in looked_in)
    return DeviceError(
        f"libOpenNI2 was not found in {places}: {_OPENNI2}, or set OPENNI2_REDIST64 to the folder that holds it"
    )


def no_device(wanted: str, listed: Iterable[str], cameras: Iterable[UsbCamera]) -> DeviceError:
    """Return the error for a device that OpenNI2 does not list: absent, forbidden, or without its driver."""
    names = "; ".join(listed)
    for camera in cameras:
        if not camera.permitted:
            return _forbidden(camera)
    if wanted and names:
        return DeviceError(f"no device {wanted}: OpenNI2 lists {names}; give one of these addresses or serial numbers")
    for camera in cameras:
        return DeviceError(f"a {camera.name} is plugged in, but OpenNI2 has no driver for it: {camera.driver}")
    return DeviceError(
        f"no {f'device {wanted}' if wanted else 'OpenNI2 device'} found: plug it in (a Kinect needs its own power "
        "supply too), look for it in the output of lsusb; a virtual machine must be given the USB device"
    )


def cannot_open(uri: str, message: str, cameras: Iterable[UsbCamera]) -> DeviceError:
    """Return the error for a device that is listed but will not open; `message` is what the driver said."""
    text = message.lower()
    cameras = tuple(cameras)
    for camera in cameras:
        if not camera.permitted:
            return _forbidden(camera)
    if "set usb interface" in text or "busy" in text or "claim" in text:
        return DeviceError(
            f"{uri} is busy ({message}): end the other program that uses it (NiViewer, a ROS driver, another odom "
            "sensor); for a Kinect v1 also `rmmod gspca_kinect`, the kernel's own driver"
        )
    if "open the usb device" in text or "access" in text or "permission" in text:
        rules = (
            " and ".join(camera.rule for camera in cameras)
            or 'SUBSYSTEM=="usb", ATTR{idVendor}=="<as lsusb says>", MODE="0666"'
        )
        return _permission(uri, message, rules)
    return DeviceError(f"{uri} cannot be opened ({message}): unplug it, plug it in again, and try another USB port")


def _forbidden(camera: UsbCamera) -> DeviceError:
    return _permission(f"the {camera.name} at {camera.node}", "permission denied", camera.rule)


def _permission(device: str, message: str, rule: str) -> DeviceError:
    return DeviceError(
        f"{device} may not be opened by this user ({message}): write {rule} into "
        "/etc/udev/rules.d/60-depth-camera.rules, then run `udevadm control --reload` and plug the camera in again"
    )


def no_frames(uri: str, stream: str, seconds: float) -> DeviceError:
    """Return the error for streams that have started but deliver nothing."""
    return DeviceError(
        f"{uri} delivers no {stream} ({seconds:g} s waited): most often the USB controller has no bandwidth left; "
        "plug the camera straight into the machine, on a controller of its own (lsusb -t), without hub; a Kinect also "
        "needs its power supply, a Kinect v2 USB 3; a smaller image (--option size=320x240) needs a quarter"
    )


def no_mode(uri: str, stream: str, wanted: str, offered: Iterable[str]) -> DeviceError:
    """Return the error for an image size or rate that the device does not have."""
    return DeviceError(f"{uri} has no {stream} mode {wanted}: it offers {', '.join(offered) or 'none'}")
