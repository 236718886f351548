"""What `odom calibrate` writes: the calibration file with remarks at its head, the report, and a picture."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from shlex import join, quote

import numpy as np

from odom.calibration.description import numbers, quality, registration
from odom.calibration.parameters import SCALE_NUMBER
from odom.calibration.residual_picture import draw
from odom.errors import writing_to
from odom.frame import DepthModel
from odom.service.calibration_run import DIFFERENT_LENS, Outcome
from sensors.calibration_file import Calibration, calibration_text
from sensors.catalogue import takes_calibration
from sensors.depth_registration import DepthRegistration, registration_text


def remarks(outcome: Outcome, sources: Sequence[str]) -> list[str]:
    """Return a calibration's report, line by line."""
    survey, result = outcome.survey, outcome.result
    lines = [
        f"odom calibrate {join(sources)}: {len(survey.T_camera_map)} frames and {len(survey.landmarks)} landmarks "
        f"adjusted {outcome.rounds} times, {len(survey)} observations",
        *numbers(result),
    ]
    if result.camera.depth != DepthModel():
        lines.append(registration(result))
    if outcome.scale is not None:
        how = "corrected by that" if result.shown[SCALE_NUMBER] else "corrected by a part of that, which is too unsure"
        lines.append(
            f"motion capture: the camera had gone {outcome.scale.ratio:.3f} ± {outcome.scale.sigma:.3f} of the true "
            f"way; the unit of depth is {how}"
        )
    lines += result.hidden()
    if not result.shown[SCALE_NUMBER]:
        usual_m = 1.0 / float(np.nanmedian(survey.inverse_depth))
        lines.append(
            f"by the unit of depth given, half of what was seen is nearer than {usual_m:.2g} m: if not, it is wrong"
        )
    if outcome.halves_apart > DIFFERENT_LENS:
        lines.append(
            f"the two halves of the recording show lenses that differ by {outcome.halves_apart:.1f} sigma: "
            "if the camera was changed on the way, calibrate them one by one (--start, --end)"
        )
    lines += ["interrupted: not judged on held-out frames"] if outcome.judgement is None else quality(outcome.judgement)
    return lines


def how_to_use(source: str, calibration: Path) -> str:
    """Return in words how to use a calibration that was found in `source`."""
    option = f"--camera {quote(str(calibration))}"
    if takes_calibration(source):
        return f"use it: odom run {quote(source)} {option}"
    return f"use it with {option}, for recordings of this camera; {source} itself takes no other camera"


def write_calibration(
    files: Sequence[Path],
    outcome: Outcome,
    text: Iterable[str],
    depth_scale: float,
    registered: DepthRegistration | None,
) -> None:
    """Write calibration, report and picture to three files; the picture needs a judgement.

    The calibration keeps the unit of the depth images that it was found in, and how they were `registered` in software.
    Raises OdomError for a file that cannot be written.
    """
    yaml_file, report, picture = files
    text = list(text)
    content = calibration_text(Calibration(outcome.result.camera, depth_scale), text)
    content += "" if registered is None else registration_text(registered)
    with writing_to(yaml_file):
        yaml_file.write_text(content, encoding="utf-8")
    with writing_to(report):
        report.write_text("\n".join(text) + "\n", encoding="utf-8")
    if outcome.judgement is not None:
        with writing_to(picture):
            draw(picture, outcome.survey, outcome.judgement, text[0])
