"""What a run leaves when its source has ended: final trajectory, report, and a calibration if it found a better one."""

import threading
import time
from collections.abc import Callable

from odom.backend import Odometry, OdometrySettings
from odom.calibration.mid_run import MidRunCalibrator
from odom.calibration.self_calibration import SelfCalibration, self_calibrated
from odom.service.calibration_fields import calibration_fields
from odom.service.calibration_offer import offer_calibration
from odom.service.closing_fields import closing_fields
from odom.service.estimate_publisher import EstimatePublisher
from odom.service.map_keeper import MapKeeper
from odom.service.progress import hand_up
from odom.service.result_files import RunFiles, write_json
from odom.service.run_statistics import RunStatistics
from odom.wire.allocator import give_back_freed


def save_results(
    odometry: Odometry, files: RunFiles, keeper: MapKeeper, publisher: EstimatePublisher, statistics: RunStatistics
) -> None:
    """Finish an odometry, write its trajectory and report, publish its last closures; raises OSError.

    The report is handed up even where the files cannot be written.
    """
    begun = time.perf_counter()
    give_back_freed()  # the final adjustment takes the most memory of the run
    poses = odometry.finish()
    keeper.save(odometry)
    statistics.add_loops(odometry.late_loops)
    publisher.publish_loops(odometry.late_loops)
    test, closed = odometry.closing_test(), odometry.closed_chain()
    publisher.publish_closed_chain(closed)
    own = _self_calibration(odometry, keeper)
    report = statistics.report() | closing_fields(test, closed) | calibration_fields(odometry, own) | keeper.report()
    try:
        report["segments"] = files.write_trajectory(own.trajectory or poses, closed)
        offer_calibration(own, files.folder)
    finally:
        hand_up(report)
    write_json(files.folder / "report.json", report | {"finish_s": round(time.perf_counter() - begun, 3)})


def _self_calibration(odometry: Odometry, keeper: MapKeeper) -> SelfCalibration:
    """Return what the run says of its calibration; a map on disk stays with the camera that it was made with."""
    if not odometry.settings.self_calibration:
        return SelfCalibration(reason="odometry.self_calibration is off")
    if keeper.has_map:
        return SelfCalibration(reason="the map is kept with the camera that it was made with")
    if isinstance(odometry.calibrator, MidRunCalibrator):
        odometry.calibrator.wait()
    return self_calibrated(odometry, latest_calibration(odometry))


def latest_calibration(odometry: Odometry) -> SelfCalibration | None:
    """Return the calibration found during the run and in use since then, None where there is none."""
    calibrator, is_changed = odometry.calibrator, odometry.camera_in_use is not odometry.camera
    return calibrator.latest if is_changed and isinstance(calibrator, MidRunCalibrator) else None


def calibrator_for(
    settings: OdometrySettings, keeper: MapKeeper, ready: threading.Event, may_wait: Callable[[], bool]
) -> MidRunCalibrator | None:
    """Return the calibrator of a running odometry, None where it keeps the given calibration.

    Until it is `ready`, frames of a source that `may_wait` wait.
    """
    return MidRunCalibrator(ready, may_wait) if settings.self_calibration and not keeper.has_map else None
