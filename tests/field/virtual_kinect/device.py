"""The folder through which a test steers one virtual Kinect (see virtual_kinect.cpp)."""

from pathlib import Path

import numpy as np


class VirtualKinect:
    """One device: `plug`, `unplug`, `switch("busy")`; keyword arguments are lines of its device.txt."""

    def __init__(self, folder: Path, **settings: object) -> None:
        self.folder = folder
        self.settings = settings
        folder.mkdir(parents=True)

    def configure(self, **settings: object) -> None:
        self.settings |= settings
        text = "".join(f"{name} {value}\n" for name, value in self.settings.items())
        (self.folder / "device.txt").write_text(text)

    def plug(self) -> None:
        (self.folder / "plugged").touch()

    def unplug(self) -> None:
        (self.folder / "plugged").unlink()

    def switch(self, fault: str, on: bool = True) -> None:
        """Let it be `busy`, `forbidden`, `starved`, or one stream only: `starved_color`, `starved_depth`."""
        (self.folder / fault).touch() if on else (self.folder / fault).unlink(missing_ok=True)

    @property
    def set_by_application(self) -> dict[str, int]:
        """What the application has set, as the driver saw it."""
        lines = (self.folder / "settings.txt").read_text().splitlines()
        return {name: int(value) for name, value in (line.split() for line in lines)}


def write_sequence(device: VirtualKinect, color: np.ndarray, depth: np.ndarray) -> None:
    """Give the device its frames: n x H x W x 3 uint8 and n x H x W uint16."""
    color.tofile(device.folder / "color.raw")
    depth.tofile(device.folder / "depth.raw")
    device.configure(frames=len(color), width=color.shape[2], height=color.shape[1])


class Kinects:
    """The folder of virtual devices."""

    def __init__(self, root: Path) -> None:
        self.root = root

    def __call__(self, name: str = "a", frames: int = 60, **settings: object) -> VirtualKinect:
        color, depth = noise(frames)
        device = VirtualKinect(self.root / name, uri=f"virtual://{name}", **settings)
        write_sequence(device, color, depth)
        device.plug()
        return device

    def watched_every(self, ms: int) -> None:
        """Let the driver look that rarely which devices are plugged in; call it before the library is loaded."""
        (self.root / "watch_ms").write_text(str(ms))


def noise(frames: int, width: int = 640, height: int = 480) -> tuple[np.ndarray, np.ndarray]:
    """Return frames whose every pixel differs from frame to frame: a swapped, torn or mirrored one cannot pass."""
    rng = np.random.default_rng(frames)
    color = rng.integers(0, 256, (frames, height, width, 3), dtype=np.uint8)
    depth = rng.integers(400, 8000, (frames, height, width), dtype=np.uint16)
    return color, depth
