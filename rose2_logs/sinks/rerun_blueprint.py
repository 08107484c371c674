"""How a recording looks when it is opened: the layout stored in it."""

from __future__ import annotations

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from rose2_logs.occupancy import FloatArray

COVERAGE_UNIT = 1e-4
"""Step of the coverage timeline, which counts in whole numbers."""
EYE_HEIGHT = 0.9
"""Height of the eye over the longer side of the map: it fills the view at the viewer's field of view."""
HIDDEN = ("/world/clean_map", "/world/lines", "/world/edges")
"""Layers that are there to be switched on."""


def make_blueprint(low_m: FloatArray, high_m: FloatArray) -> rrb.Blueprint:
    """Map from above beside curves, events and the summary; time runs along coverage.

    Parameters
    ----------
    low_m, high_m : (2,) float
        Corners of the explored part in world metres.
    """
    centre = (low_m + high_m) / 2
    height = EYE_HEIGHT * float(max(high_m[0] - low_m[0], high_m[1] - low_m[1], 1.0))
    eye = rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital,
        position=[centre[0], centre[1] - 1e-3 * height, height],
        look_target=[centre[0], centre[1], 0.0],
        eye_up=[0.0, 1.0, 0.0],
    )
    whole_run = rr.encodings.TimeRange(
        start=rr.encodings.TimeRangeBoundary.absolute(seq=0),
        end=rr.encodings.TimeRangeBoundary.absolute(seq=round(1 / COVERAGE_UNIT)),
    )

    def curves(name: str, origin: str) -> rrb.TimeSeriesView:
        axis = rrb.archetypes.TimeAxis(link="Independent", view_range=whole_run)
        return rrb.TimeSeriesView(name=name, origin=origin, axis_x=axis)

    hidden = rrb.EntityBehavior(visible=False)
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Spatial3DView(
                name="Rooms",
                origin="/world",
                eye_controls=eye,
                line_grid=False,
                background=[236, 236, 236],
                overrides=dict.fromkeys(HIDDEN, hidden),
            ),
            rrb.Vertical(
                curves("Coverage", "/run/coverage"),
                curves("Number of rooms", "/run/rooms"),
                curves("Area of each room, m2", "/run/area"),
                rrb.Tabs(
                    rrb.TextLogView(name="Events", origin="/events"),
                    rrb.TextDocumentView(name="Summary", origin="/summary"),
                ),
            ),
            column_shares=[3, 2],
        ),
        rrb.TimePanel(timeline="coverage", state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        auto_views=False,
    )


def corners_of(known_corners_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Low and high corner (2,) of a set of points (K, 2)."""
    return np.min(known_corners_m, axis=0), np.max(known_corners_m, axis=0)
