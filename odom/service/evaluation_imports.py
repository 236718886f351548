"""Loads what the end of a run needs, evaluation and plot, while the odometry starts or works."""

import threading
from pathlib import Path

from odom.wire.codec.cdr import DIAGNOSTICS, typestore


class EvaluationImports:
    """Imports evaluation and plot in a thread of its own: they take half a second, which would delay the end.

    It is done when truth is `expected`, or when there is some to judge the run in `out` by: a run without truth does
    not need them.
    """

    def __init__(self, out: Path, expected: bool) -> None:
        self._truth = out / "truth.txt"
        self._expected = expected
        self._thread: threading.Thread | None = None

    def begin_if_due(self) -> None:
        """Begin if it is time; to be called again and again once the other processes are loaded, not to delay them."""
        if self._thread is None and (self._expected or self._truth.is_file()):
            self._thread = threading.Thread(target=_load, name="evaluation-imports", daemon=True)
            self._thread.start()


def _load() -> None:
    typestore(DIAGNOSTICS)  # which the first status would wait for
    from odom.evaluation import run_report

    run_report.load_drawing()
