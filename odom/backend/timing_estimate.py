"""What is known of the sensor's timing: its priors, and what the adjustments have said since."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from odom.backend.bundle import Bundle
from odom.backend.settings import OdometrySettings
from odom.frontend.timing import Timing

Array = NDArray[np.float64]

_FORGET = 0.95


@dataclass(frozen=True, eq=False)
class TimingEstimate:
    """The `timing` and the `information` (3 x 3, 1/s^2) on it."""

    timing: Timing
    information: Array

    @classmethod
    def of(cls, settings: OdometrySettings) -> "TimingEstimate":
        """Return what the settings say of a device that has shown nothing yet."""
        sigma_s = [
            settings.readout_prior_sigma_s,
            settings.depth_lag_prior_sigma_s,
            settings.depth_readout_prior_sigma_s,
        ]
        timing = Timing(settings.readout_prior_s, settings.depth_lag_prior_s, settings.depth_readout_prior_s)
        return cls(timing, np.diag(np.array(sigma_s) ** -2.0))

    def after(self, adjusted: Bundle, credit: float) -> "TimingEstimate":
        """Return the estimate after an adjustment, whose information counts for its share `credit`."""
        timing, information = self.timing.changed(adjusted.timing_change), self.information
        if adjusted.information_timing is not None:
            information = _FORGET * information + credit * adjusted.information_timing
        return TimingEstimate(timing, information)
