"""How a recording looks when it is opened: the layout stored in it."""

from __future__ import annotations

from collections.abc import Collection, Iterable

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from rose2_logs.config.run_options import RECORDING_LAYERS
from rose2_logs.model.occupancy import FloatArray
from rose2_logs.outputs.rerun.back_projected import BACK_PROJECTED, SEEN_SHARE
from rose2_logs.outputs.rerun.lanes import FINAL_IOU, FINAL_SHARE, KNOWN_FINAL_SHARE, LANES, SHIFTS
from rose2_logs.outputs.rerun.layers import Instant
from rose2_logs.outputs.rerun.legend import CURVE_NAMES, LEGEND_TEXT, MAP_SIGNS
from rose2_logs.outputs.rerun.world import (
    BORDERS,
    CLEAN,
    DARK,
    DOORWAYS,
    FACES,
    FILLS,
    LINES,
    PAPER,
    PATH,
    PATH_IN_PART,
    PREDICTED,
    ROBOT,
    ROOMS,
    SCORE,
    SEGMENTS,
    SPECTRUM,
    VORONOI,
)

EYE_HEIGHT = 1.02
"""Height of the eye over the side of the map that fills the view: the viewer sees 1.04 times its height."""
MAP_ASPECT = 1.25
"""Width over height of the view of the map in a window of usual shape."""
SWITCHED = (BORDERS, CLEAN, SCORE, SEGMENTS, LINES, FACES, VORONOI)
"""Layers of the map's view that are off at first and can be switched on."""
PLAY_S = 20.0
"""Time that playing the run takes, whatever its length."""
SIDE_SHARE, CURVES_SHARE, SIGNS_SHARE, NAMES_SHARE = 0.4, 0.36, 0.05, 0.13
"""Shares of the window on a screen from 1280 x 720 on: of its width for what is beside the map, of its height
for the curves there; of the map's height, and of the curves', for the strip of their legend."""
Overrides = list[rrb.EntityBehavior | rrb.VisibleTimeRanges]


def make_blueprint(
    low_m: FloatArray,
    high_m: FloatArray,
    layers: Collection[str] = RECORDING_LAYERS,
    *,
    back_projected: bool = False,
    first_percent: int = 0,
    most_rooms: int = 0,
    in_parts: bool = False,
) -> rrb.Blueprint:
    """Map from above and a tab per stage of the method; next to it curves, summary, room lanes, events.

    A recording opens on its last map and stands there; when played, it begins at the first.

    Parameters
    ----------
    low_m, high_m : (2,) float
        Corners of what is shown, world meters.
    layers : collection of str
        The optional layers that the recording has; tabs without any are left out.
    back_projected : bool
        Whether it has the back-projected rooms.
    first_percent : int
        Coverage of the first map, where playing begins.
    most_rooms : int
        Greatest number of rooms of a map; 0 if it is not known.
    in_parts : bool
        Whether the recording may be of a run in parts, with the robot's path in each.
    """
    stages = (
        ("Rooms", (), ()),
        ("Borders", ("borders",), (BORDERS,)),
        ("Clean map", ("clean_map",), (CLEAN,)),
        ("Structure score", ("score",), (SCORE,)),
        ("Walls", ("segments", "lines"), (SEGMENTS, LINES)),
        ("Faces", ("faces",), (FACES,)),
        ("Voronoi graph", ("voronoi",), (VORONOI,)),
    )
    views: list[rrb.View] = [
        _map_view(name, low_m, high_m, shown, (BACK_PROJECTED,) if back_projected else (), in_parts=in_parts)
        for name, needed, shown in stages
        if not needed or set(needed) & set(layers)
    ]
    if back_projected:
        of_last = (BACK_PROJECTED,)
        views.insert(1, _map_view("Rooms projected back", low_m, high_m, of_last, in_parts=in_parts))
    if "spectrum" in layers:
        eye = eye_above(np.array([-1.0, -1.0]), np.array([1.0, 1.0]))
        views.append(
            rrb.Spatial3DView(
                name="Spectrum", origin=SPECTRUM, eye_controls=eye, line_grid=False, background=DARK
            )
        )
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(
                rrb.Tabs(*views, active_tab=0),
                _strip(MAP_SIGNS),
                row_shares=[1 - SIGNS_SHARE, SIGNS_SHARE],
            ),
            rrb.Vertical(
                rrb.Tabs(*_curve_views(back_projected, most_rooms), active_tab=0),
                rrb.Tabs(
                    rrb.TextDocumentView(name="Summary", origin="/summary"),
                    rrb.StateTimelineView(name="Room history", origin=LANES, time_view=_axis()),
                    rrb.TextLogView(
                        name="Events",
                        origin="/events",
                        columns=rrb.TextLogColumns(
                            timeline_columns=["snapshot"], text_log_columns=["loglevel", "body"]
                        ),
                    ),
                    rrb.TextDocumentView(name="Legend", origin=LEGEND_TEXT),
                    active_tab=0,
                ),
                row_shares=[CURVES_SHARE, 1 - CURVES_SHARE],
            ),
            column_shares=[1 - SIDE_SHARE, SIDE_SHARE],
        ),
        # A viewer that follows shows the end of a file, all of which is there.
        rrb.TimePanel(
            timeline="coverage_percent",
            state="collapsed",
            play_state="following",
            fps=max(100 - first_percent, 1) / PLAY_S,
        ),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        auto_views=False,
    )


def _map_view(
    name: str,
    low_m: FloatArray,
    high_m: FloatArray,
    shown: Collection[str],
    off: Collection[str] = (),
    *,
    in_parts: bool,
) -> rrb.Spatial3DView:
    """View of the map with some of the switched layers on; rooms step back where others are looked at."""
    hidden = [*(path for path in SWITCHED if path not in shown), *off]
    if BACK_PROJECTED in shown:
        hidden += [FILLS, ROOMS, PREDICTED, DOORWAYS]
    elif shown:
        hidden += [PREDICTED, PATH, ROBOT, *([PATH_IN_PART] if in_parts else [])]
    if set(shown) & {CLEAN, SCORE, SEGMENTS, LINES, VORONOI}:
        hidden += [FILLS, ROOMS]
    overrides: dict[rr.EntityPath | str, Overrides] = {
        path: [rrb.EntityBehavior(visible=False)] for path in hidden
    }
    # The path so far: the pieces of all maps up to the present one.
    overrides[PATH] = [*overrides.get(PATH, []), _up_to_now()]
    return rrb.Spatial3DView(
        name=name,
        origin="/world",
        eye_controls=eye_above(low_m, high_m),
        line_grid=False,
        background=DARK if SCORE in shown else PAPER,
        overrides=overrides,
    )


def _up_to_now() -> rrb.VisibleTimeRanges:
    before = rr.encodings.TimeRangeBoundary.infinite()
    now = rr.encodings.TimeRangeBoundary.cursor_relative(seq=0)
    return rrb.VisibleTimeRanges(
        [rrb.VisibleTimeRange(name, start=before, end=now) for name in Instant._fields]
    )


def view_side_m(low_m: FloatArray, high_m: FloatArray, aspect: float = MAP_ASPECT) -> float:
    """Height of the part of the world that a view of such an aspect shows so that a rectangle fits in."""
    size = high_m - low_m
    return float(max(size[0] / aspect, size[1], 1e-3))


def eye_above(low: FloatArray, high: FloatArray, aspect: float = MAP_ASPECT) -> rrb.EyeControls3D:
    """Look from above so that a rectangle fills a view of such an aspect."""
    center, height = (low + high) / 2, EYE_HEIGHT * view_side_m(low, high, aspect)
    return rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital,
        position=[center[0], center[1] - 1e-3 * height, height],
        look_target=[center[0], center[1], 0.0],
        eye_up=[0.0, 1.0, 0.0],
    )


def _axis() -> rrb.archetypes.TimeAxis:
    """Return an axis over the whole run, whichever timeline it goes along; by default a plot is zoomed in."""
    end = rr.encodings.TimeRangeBoundary.infinite()
    whole_run = rr.encodings.TimeRange(start=end, end=end)
    return rrb.archetypes.TimeAxis(link="Independent", view_range=whole_run)


def _curve_views(back_projected: bool, most_rooms: int) -> list[rrb.View | rrb.Container]:
    """Views of everything that is a curve, what matters most first."""
    agreement = "Agreement with the final layout"
    paths = ("/run/coverage", FINAL_SHARE, KNOWN_FINAL_SHARE, FINAL_IOU, SHIFTS)
    views: list[rrb.View | rrb.Container] = [
        rrb.Vertical(
            _strip(CURVE_NAMES),
            _curves(f"{agreement}, %", paths, (0.0, 105.0), titlebar=False),
            row_shares=[NAMES_SHARE, 1 - NAMES_SHARE],
            name=agreement,
        ),
        _curves("Area, m²", ("/run/area/**",)),
    ]
    if back_projected:
        views.append(_curves("Seen share, %", (f"{SEEN_SHARE}/**",)))
    # From 0 on, so that also a small plot has two figures beside its axis.
    count_span = (0.0, 1.05 * most_rooms) if most_rooms else None
    return [
        *views,
        _curves("Room count", ("/run/rooms",), count_span),
        _curves("Change", ("/run/variation_bits",)),
    ]


def _curves(
    name: str, paths: Iterable[str], span: tuple[float, float] | None = None, *, titlebar: bool = True
) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(
        name=name,
        origin="/run",
        contents=list(paths),
        axis_x=_axis(),
        axis_y=None if span is None else rrb.ScalarAxis(range=span),
        # It would hide much of a small plot.
        plot_legend=rrb.PlotLegend(visible=False),
        titlebar=titlebar,
    )


def _strip(path: str) -> rrb.Spatial2DView:
    """Show a strip of a legend, without a title of its own."""
    return rrb.Spatial2DView(name="Signs", origin=path, titlebar=False, background=PAPER)
