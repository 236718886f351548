"""Is a recording or a live sensor good enough for odometry? Pure measurements, each with a verdict and advice.

Where a limit names no other source, it was chosen by trial on TUM's fr1_xyz and the arena, such that every fault of
tests/evaluation/test_doctor.py is found there and a good recording passes. A smaller limit calls good recordings bad,
a larger one misses faults, unless the limit says otherwise.
"""

from odom.evaluation.diagnosis.examine import examine as examine
from odom.evaluation.diagnosis.finding import Finding as Finding
from odom.evaluation.diagnosis.finding import Verdict as Verdict
from odom.evaluation.diagnosis.form import advice_on_refused as advice_on_refused
from odom.evaluation.diagnosis.recording import NO_FILE as NO_FILE
from odom.evaluation.diagnosis.recording import NOT_DEPTH as NOT_DEPTH
from odom.evaluation.diagnosis.recording import Recording as Recording
from odom.evaluation.diagnosis.tracking import judge_tracking as judge_tracking
from odom.evaluation.diagnosis.z_levels import judge_levels as judge_levels
