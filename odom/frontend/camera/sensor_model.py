"""All that is known of the camera, in one value: lens, timing of its shutters, clock of its stamps, and noise."""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from odom.frame import Stamp
from odom.frontend.camera.depth_tilt import TILTS, DepthTilt
from odom.frontend.camera.lens import Lens
from odom.frontend.camera.noise_monitor import NoiseMonitor
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.frontend.camera.stamp_clock import StampClock
from odom.frontend.camera.tuning import TUNING
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
    depth_tilt: DepthTilt = field(default_factory=DepthTilt)

    @cached_property
    def readout_variance(self) -> float:
        """The variance (s^2) of the timing's `readout_s`."""
        return float(np.linalg.inv(self.timing_information)[0, 0])

    @property
    def since_middle_variance(self) -> float:
        """The variance (s^2) of the timing's `since_middle_s`, half of the readout."""
        return 0.25 * self.readout_variance

    @property
    def adjusted_information(self) -> Array:
        """The information (5 x 5) of all that adjustments change: the timing, then the tilt."""
        timings = len(self.timing_information)
        information = np.zeros((timings + TILTS, timings + TILTS))
        information[:timings, :timings] = self.timing_information
        information[timings:, timings:] = self.depth_tilt.adjusted_information
        return information

    def with_adjusted(
        self, change: Array, information: Array | None, pull: Array | None, credit: float
    ) -> "SensorModel":
        """Return the model after an adjustment has moved timing and tilt by `change` (5), see `with_timing_change`.

        `information` (5 x 5) is what the adjusted observations say of both together, `pull` (5) how much they would
        still move them.
        """
        timings = len(self.timing_information)
        if information is None or pull is None:
            return self.with_timing_change(change[:timings], None, credit)
        A, B, C = information[:timings, :timings], information[:timings, timings:], information[timings:, timings:]
        prior = self.adjusted_information / credit
        of_timing = A - B @ np.linalg.solve(C + prior[timings:, timings:], B.T)
        of_tilt = C - B.T @ np.linalg.solve(A + prior[:timings, :timings], B)
        known = self.with_timing_change(change[:timings], of_timing, credit)
        if self.depth_tilt.is_shown:
            return replace(known, depth_tilt=self.depth_tilt.with_change(change[timings:], credit * of_tilt))
        share = credit * self.noise.covariance_scale  # a tilt itself makes the halves of an image disagree
        return replace(known, depth_tilt=self.depth_tilt.with_evidence(pull[timings:], of_tilt, share))

    def change_to(self, other: "SensorModel") -> Array:
        """Return the change (5) of timing and tilt to those of `other`, as adjustments count it."""
        tilted = other.depth_tilt.angles - self.depth_tilt.angles
        return np.concatenate([self.timing.change_to(other.timing), tilted])

    def as_known_before(self, before: "SensorModel") -> "SensorModel":
        """Return the model with timing and tilt, which adjustments change, as they were `before`.

        Whether there is a tilt is kept.
        """
        is_new = self.depth_tilt.is_shown and not before.depth_tilt.is_shown
        tilt = DepthTilt(is_shown=True) if is_new else before.depth_tilt
        return replace(self.with_timing_of(before), depth_tilt=tilt)

    def with_timing_of(self, other: "SensorModel") -> "SensorModel":
        """Return the model with the timing as it is known of the `other`."""
        return replace(self, timing=other.timing, timing_information=other.timing_information)

    def with_timing_change(self, change: Array, information: Array | None, credit: float) -> "SensorModel":
        """Return the model after an adjustment has moved the timing by `change` (3, s).

        `information` (3 x 3, 1/s^2) is what the adjusted observations say of it, of which the share `credit` counts;
        what was known before fades, so that the timing can follow a device that warms up.
        """
        known = self.timing_information
        if information is not None:
            known = TUNING.timing_memory * known + credit * information
        timing = self.timing.changed(change)
        before_after = self.timing.by_change_of(timing)
        return replace(self, timing=timing, timing_information=before_after.T @ known @ before_after)

    def with_stamp(self, stamp: Stamp) -> "SensorModel":
        """Return the model after one more colour image, stamped `stamp`."""
        return replace(self, clock=self.clock.after(stamp))

    def with_lens(self, lens: Lens) -> "SensorModel":
        """Return the model with another lens; its tilt is unknown again."""
        return replace(self, lens=lens, depth_tilt=DepthTilt())

    def with_noise(self, noise: NoiseMonitor) -> "SensorModel":
        """Return the model with what the newest frame has shown of the noise."""
        return replace(self, noise=noise)
