"""The arrangement of the views: the map, the images, what is measured, and what happened in words."""

import rerun.blueprint as rrb

from odom.viewer import entities
from odom.viewer.entities import TIMELINE
from odom.viewer.framing import Frame

_GROUND = (13, 16, 20)
"""RGB of the background: nearly black, which shows the palette best."""
_UP = (0.0, -1.0, 0.0)
"""Up of the eye: y is down in the first camera."""


def blueprint(frame: Frame | None = None, timeline: str = TIMELINE) -> rrb.Blueprint:
    """Return the blueprint with the eye of the map at `frame`; plots follow the last minute of `timeline`.

    Without a frame the eye stands where Rerun puts it.
    """
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(
                _map(frame),
                rrb.Horizontal(
                    rrb.TextDocumentView(origin=entities.SUMMARY, name="How it goes"),
                    rrb.TextLogView(
                        origin=entities.LOG,
                        name="What happened",
                        columns=rrb.TextLogColumns(
                            timeline_columns=[rrb.encodings.TimelineColumn(timeline, visible=False)],
                            text_log_columns=["loglevel", "body"],
                        ),
                    ),
                    column_shares=[1, 1.7],
                ),
                row_shares=[2.3, 1],
            ),
            rrb.Vertical(
                rrb.Horizontal(
                    rrb.Spatial2DView(origin=entities.COLOR, name="Colour, features by residual", background=_GROUND),
                    rrb.Spatial2DView(origin=entities.DEPTH, name="Depth", background=_GROUND),
                ),
                rrb.Horizontal(
                    _plot(entities.POSITION_ERROR, "Position error, mm (grey: 3 sigma)", timeline),
                    _plot(entities.ROTATION_ERROR, "Rotation error, deg (grey: 3 sigma)", timeline),
                ),
                rrb.Horizontal(
                    _plot(entities.INLIERS, "Inliers (green) of matches (grey)", timeline),
                    _plot(entities.TIMES, "Processing (blue), latency (orange), ms", timeline),
                ),
                row_shares=[1.15, 1, 1],
            ),
            column_shares=[1.25, 1],
        ),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        rrb.TimePanel(state="collapsed", timeline=timeline, play_state="following"),
        auto_layout=False,
        auto_views=False,
    )


def _map(frame: Frame | None) -> rrb.Spatial3DView:
    eye = (
        rrb.EyeControls3D(position=frame.eye, look_target=frame.look_at, eye_up=_UP)
        if frame is not None
        else rrb.EyeControls3D(eye_up=_UP)
    )
    return rrb.Spatial3DView(
        origin=entities.WORLD,
        name="Map: online (orange), corrected (blue; not joined: pink), chain (yellow; closed: violet), truth (white)",
        contents=["+ $origin/**", f"- {entities.DEPTH}/**", f"- {entities.FEATURES}/**"],
        background=rrb.Background(color=_GROUND),
        line_grid=rrb.LineGrid3D(visible=False),
        eye_controls=eye,
    )


def _plot(path: str, name: str, timeline: str) -> rrb.TimeSeriesView:
    ranges = rrb.VisibleTimeRange(
        timeline,
        start=rrb.TimeRangeBoundary.cursor_relative(seconds=-60.0),
        end=rrb.TimeRangeBoundary.cursor_relative(),
    )
    return rrb.TimeSeriesView(
        origin=path,
        name=name,
        time_ranges=ranges,
        plot_legend=rrb.PlotLegend(visible=False),
        axis_y=rrb.ScalarAxis(zoom_lock=False),
    )
