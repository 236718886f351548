"""What a run leaves when its source has ended: final trajectory, report, and a calibration if it found a better one."""

import time

from odom.backend import Odometry
from odom.service.calibration_offer import offer_calibration
from odom.service.closing_fields import closing_fields
from odom.service.estimate_publisher import EstimatePublisher
from odom.service.map_keeper import MapKeeper
from odom.service.progress import hand_up
from odom.service.result_files import RunFiles, write_json
from odom.service.run_calibration import calibration_fields, final_calibration
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
    odometry.finish_map()
    keeper.save(odometry)
    statistics.unwritten_changes = keeper.unwritten
    statistics.add_loops(odometry.late_loops)
    publisher.publish_loops(odometry.late_loops)
    test, closed = odometry.closing_test(), odometry.closed_chain()
    publisher.publish_closed_chain(closed)
    calibration = final_calibration(odometry, keeper.has_map, statistics.tracked_share)
    report = statistics.report() | closing_fields(test, closed)
    report |= calibration_fields(odometry, calibration) | keeper.report()
    try:
        report["segments"] = files.write_trajectory(calibration.trajectory or odometry.final_trajectory(), closed)
        offer_calibration(calibration, files.folder)
    finally:
        hand_up(report)
    write_json(files.folder / "report.json", report | {"finish_s": round(time.perf_counter() - begun, 3)})
