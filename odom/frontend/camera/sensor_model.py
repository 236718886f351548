"""All that is known of the camera, in one value: lens, timing of its shutters, clock of its stamps, and noise."""

from dataclasses import dataclass, replace

from odom.frame import Stamp
from odom.frontend.camera.lens import Lens
from odom.frontend.camera.noise_monitor import NoiseMonitor
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.frontend.camera.stamp_clock import StampClock
from odom.frontend.tuning import TUNING
from odom.geometry.arrays import Array


@dataclass(frozen=True, eq=False)
class SensorModel:
    """What the stream has shown of its camera so far; a new value takes this one's place as more is learnt.

    `timing_information` (3 x 3, 1/s^2) says how well the numbers of `timing` are known.
    """

    lens: Lens
    timing: ShutterTiming
    timing_information: Array
    clock: StampClock
    noise: NoiseMonitor

    def with_timing_change(self, change: Array, information: Array | None, credit: float) -> "SensorModel":
        """Return the model after an adjustment has moved the timing by `change` (3, s).

        `information` (3 x 3, 1/s^2) is what the adjusted observations say of it, of which the share `credit` counts;
        what was known before fades, so that the timing can follow a device that warms up.
        """
        known = self.timing_information
        if information is not None:
            known = TUNING.timing_memory * known + credit * information
        return replace(self, timing=self.timing.changed(change), timing_information=known)

    def with_stamp(self, stamp: Stamp) -> "SensorModel":
        """Return the model after one more colour image, stamped `stamp`."""
        return replace(self, clock=self.clock.after(stamp))

    def with_lens(self, lens: Lens) -> "SensorModel":
        """Return the model with another lens."""
        return replace(self, lens=lens)

    def with_noise(self, noise: NoiseMonitor) -> "SensorModel":
        """Return the model with what the newest frame has shown of the noise."""
        return replace(self, noise=noise)
