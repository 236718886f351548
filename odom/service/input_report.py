"""The images of a whole run: what the sensor gave and left out, and what the odometry made of the rest."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from odom.wire.image_counts import MISSING, NOT_REACHED, ImageCounts

STREAMS = ("colour", "depth")


def source_report(
    sent: int,
    length: int | None,
    has_ended: bool,
    refused: Mapping[tuple[str, str], int],
    damage: Sequence[str] = (),
) -> dict[str, Any]:
    """Return what a sensor says at its end: colour images `sent`, those `refused` by stream and reason, and `damage`.

    `length` is how many colour images it should have had, if known: where it `has_ended`, the rest counts as missing.
    """
    by_stream = {stream: {why: n for (of, why), n in refused.items() if of == stream} for stream in STREAMS}
    lacking = (length or 0) - sent - sum(by_stream["colour"].values())
    if has_ended and lacking > 0:
        by_stream["colour"][MISSING] = lacking
    return {"sent": sent, "refused": by_stream, "damage": list(damage)}


def with_source(report: Mapping[str, Any], source: Mapping[str, Any] | None) -> dict[str, Any]:
    """Return the odometry's report with what the sensor said at its end, None when it said nothing.

    Of both streams `given` is then the sum of `used` and `refused`, and `completeness` the share of colour images given
    that were tracked; `source_damage` says in words what is cut, damaged or missing in the source. A report of a
    process that died has no images but those it has counted.
    """
    frames = report["frames"]
    nothing = {"given": frames, "used": frames, "refused": {}}
    images = {stream: ImageCounts.of_report(report.get(stream, nothing)) for stream in STREAMS}
    if "depth" not in report:
        del images["depth"]
    color = images["colour"]
    if source is not None:
        images = {stream: counts.plus(source["refused"][stream]) for stream, counts in images.items()}
        unreached = max(0, source["sent"] - color.given)
        images["colour"] = images["colour"].plus(Counter({NOT_REACHED: unreached}))
    found = completeness(report["tracked"], images["colour"].given)
    whole = {**report, "completeness": found} | {stream: counts.report() for stream, counts in images.items()}
    return whole if source is None else whole | {"source_damage": source["damage"]}


def completeness(tracked: int, given: int) -> float | None:
    """Return the share of the colour images given that were tracked, None without any."""
    return round(tracked / given, 4) if given else None
