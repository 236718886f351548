"""What can be read on a sheet that was drawn: which texts lie on each other, and which are cut at its edge."""

from itertools import combinations

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text


def sheets_drawn(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """Return a list into which each figure comes that is saved from now on."""
    drawn: list[Figure] = []
    save = Figure.savefig

    def kept(figure: Figure, *arguments: object, **named: object) -> None:
        drawn.append(figure)
        save(figure, *arguments, **named)

    monkeypatch.setattr(Figure, "savefig", kept)
    return drawn


def cut(figure: Figure) -> list[str]:
    """Return the texts that reach beyond the sheet."""
    canvas = FigureCanvasAgg(figure)
    figure.draw_without_rendering()
    sheet = figure.bbox.padded(1.0)
    boxes = {text: text.get_window_extent(canvas.get_renderer()) for text in _texts(figure)}
    return [t.get_text() for t, b in boxes.items() if not (sheet.contains(*b.min) and sheet.contains(*b.max))]


def on_each_other(figure: Figure) -> list[tuple[str, str]]:
    """Return the pairs of texts that cover a part of each other."""
    canvas = FigureCanvasAgg(figure)
    figure.draw_without_rendering()
    boxes = {text: text.get_window_extent(canvas.get_renderer()) for text in _texts(figure)}
    return [(a.get_text(), b.get_text()) for a, b in combinations(boxes, 2) if boxes[a].overlaps(boxes[b])]


def _texts(figure: Figure) -> list[Text]:
    """Return what is written on the sheet, numbers of axes as far as these reach."""
    beyond = set()
    for panel in figure.axes:
        for axis in (panel.xaxis, panel.yaxis):
            low, high = sorted(axis.get_view_interval())
            for labels, places in (
                (axis.get_majorticklabels(), axis.get_majorticklocs()),
                (axis.get_minorticklabels(), axis.get_minorticklocs()),
            ):
                beyond |= {text for text, at in zip(labels, places, strict=False) if not low <= at <= high}
    texts = figure.findobj(lambda one: isinstance(one, Text) and one.get_visible() and one.get_text().strip())
    return [text for text in texts if text not in beyond]
