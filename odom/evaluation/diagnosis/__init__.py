"""Is a recording or a live sensor good enough for odometry? Pure measurements, each with a verdict and an advice."""

from odom.evaluation.diagnosis.examine import Recording, examine
from odom.evaluation.diagnosis.finding import Finding, Verdict

__all__ = ["Finding", "Recording", "Verdict", "examine"]
