"""Which kind of shutter a camera has: rows are read downwards, all at once, or upwards, as where it hangs upside down.

One kind is expected. An adjustment cannot lead from there to another one at once: its prior holds it, and the first
frames were measured by what was expected. So the first adjustments are tried with each kind, and what is seen decides
(Bayes factors: R. Kass, A. Raftery, Journal of the American Statistical Association 90, 1995). Where velocity hardly
changes, all kinds explain the same images, and nothing is decided.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from odom.backend.map.map import Map
from odom.backend.mapping.bundle_adjustment import Bundle
from odom.backend.mapping.map_adjustment import Adjustment, newest
from odom.backend.mapping.tuning import TUNING
from odom.frontend.camera.rolling_shutter import ShutterTiming
from odom.frontend.camera.sensor_model import SensorModel


@dataclass(frozen=True, eq=False)
class ShutterKind:
    """The sensor as known before the run, by the kind of shutter that is believed, and by the `others` that may be."""

    beforehand: SensorModel
    others: tuple[SensorModel, ...]

    @classmethod
    def expected(cls, sensor: SensorModel) -> "ShutterKind":
        """Return the kind of a sensor that has shown nothing yet; no other may be where its readout is known well."""
        timing = sensor.timing
        if not timing.readout_s or not _is_in_doubt(sensor, timing.readout_s):
            return cls(sensor, ())
        at_once = ShutterTiming(0.0, timing.depth_lag_s + timing.since_middle_s, 0.0)
        reverse = replace(timing, readout_s=-timing.readout_s, depth_readout_s=-timing.depth_readout_s)
        return cls(sensor, tuple(replace(sensor, timing=other) for other in (at_once, reverse)))

    def trials(self, map_: Map, window: int, sensor: SensorModel) -> list[Adjustment]:
        """Return the adjustments of the `window` newest key frames by the believed kind and each other that may be.

        `sensor` is what is known by now; none where that leaves no doubt, or where there are no two key frames yet.
        """
        longest_s = max(abs(kind.timing.readout_s) for kind in self._kinds)
        if not self.others or len(map_.keyframes) < 2 or not _is_in_doubt(sensor, longest_s):
            return []
        credit = 1.0 / sensor.noise.covariance_scale
        return [newest(map_, window, sensor.with_timing_of(kind), credit) for kind in self._kinds]

    def tried(self, trials: Sequence[Adjustment]) -> tuple["ShutterKind", tuple[Adjustment, Bundle] | None]:
        """Run the `trials`; return the kind believed then, and where it is another one, its trial and result."""
        results = [trial.run() for trial in trials]
        kind = self.after([result.chi2 for result in results])
        if kind.beforehand is self.beforehand:
            return kind, None
        best = self._kinds.index(kind.beforehand)
        return kind, (trials[best], results[best])

    def after(self, chi2: Sequence[float]) -> "ShutterKind":
        """Return the kind after trials ended with these `chi2`, of the believed one and of each other."""
        if not chi2:
            return self
        kinds = self._kinds
        best = int(np.argmin(chi2))
        if chi2[0] > chi2[best] + TUNING.shutter_believed_chi2:
            return ShutterKind(kinds[best], (*kinds[:best], *kinds[best + 1 :]))
        refuted = chi2[0] + TUNING.shutter_refuted_chi2
        return ShutterKind(self.beforehand, tuple(kinds[k] for k in range(1, len(kinds)) if chi2[k] < refuted))

    @property
    def _kinds(self) -> tuple[SensorModel, ...]:
        return self.beforehand, *self.others


def _is_in_doubt(sensor: SensorModel, readout_s: float) -> bool:
    """Return whether one sigma of the readout is more than a small share of `readout_s`."""
    return sensor.readout_variance > (TUNING.readout_in_doubt * readout_s) ** 2
