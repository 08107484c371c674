"""The picture of two layouts: each in its place, what differs in the colors of the legend."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import shapely
from support.drawn_plans import two_rooms_plan

from rose2_logs.comparison.final_layout import FinalLayout
from rose2_logs.comparison.layouts import LayoutComparison
from rose2_logs.comparison.placement import PlacedMap, Placement
from rose2_logs.comparison.room_changes import RoomChange
from rose2_logs.comparison.wall_changes import WallChange, WallComparison
from rose2_logs.config.parameters import OccupancyParameters
from rose2_logs.drawing.comparison_picture import ROOM_COLORS, WALL_COLORS, draw_comparison
from rose2_logs.drawing.palette import track_color
from rose2_logs.drawing.shapes import Area, Lines, Picture, Text
from rose2_logs.model.occupancy import OccupancySnapshot
from rose2_logs.tracking.registration import RigidMotion

NOTHING = shapely.Polygon()


@pytest.fixture
def comparison() -> LayoutComparison:
    """A has rooms 1 and 2; in B, which lies 3 m to the left of it, the first is 7 and the second is gone."""
    plan = two_rooms_plan(origin_xy_m=(0.0, 0.0))
    snapshot = OccupancySnapshot(0, 0, 0, "drawn", plan.map.cells, plan.map.geometry)
    left, right = (room.shape for room in plan.rooms)
    moved = dataclasses.replace(plan.map.geometry, origin_xy_m=(-3.0, 0.0))
    occupancy = OccupancyParameters()
    b_to_a = RigidMotion.moving(np.zeros(2), np.array([3.0, 0.0]), 0.0)
    a = FinalLayout("a", PlacedMap(snapshot, occupancy), (1, 2), (left, right), np.array([12.0, 6.0]), None)
    b = FinalLayout(
        "b",
        PlacedMap(dataclasses.replace(snapshot, geometry=moved), occupancy),
        (7,),
        (shapely.transform(left, lambda xy: xy - (3.0, 0.0)),),
        np.array([12.0]),
        None,
    )
    rooms = (
        RoomChange("same", (1,), (7,), 1.0, 1.0, 1.0, 12.0, 12.0, left, left),
        RoomChange("missing", (2,), (), 0.0, None, 1.0, 6.0, 0.0, right, NOTHING),
        RoomChange("unseen", (), (9,), 0.0, None, 0.0, 0.0, 4.0, NOTHING, shapely.box(1, 0, 3, 0.9)),
    )
    walls = WallComparison(
        (
            WallChange("moved", np.array([1.0, 1, 5, 1]), np.array([1.0, 1.3, 5, 1.3]), 0.3),
            WallChange("new", None, np.array([5.0, 1, 5, 4])),
        ),
        20.0,
        20.0,
    )
    return LayoutComparison(a, b, Placement(b_to_a, 1.0, 1.0, 1.0, 0.1), rooms, walls)


def test_statuses_stand_in_the_legend_in_their_colors(comparison: LayoutComparison):
    page = draw_comparison(comparison)
    texts = {each.text for each in page.shapes if isinstance(each, Text)}
    assert {"same: 1", "missing: 1", "unseen: 1", "wall moved: 4.0 m", "wall new: 3.0 m"} <= texts
    assert {"what differs", "A: a", "B: b, laid over A"} <= texts
    fills = [each.fill for each in page.shapes if isinstance(each, Area)]
    assert fills.count(ROOM_COLORS["missing"]) == 2  # the room, and the legend's box
    lines = [each for each in page.shapes if isinstance(each, Lines)]
    assert sum(each.color == WALL_COLORS["moved"] for each in lines) == 3
    thin, *_, thick = sorted(each.width for each in lines if each.color == WALL_COLORS["moved"])
    assert thin < thick


def test_rooms_are_named_and_partners_share_a_color(comparison: LayoutComparison):
    """What is the same needs no number in the panel of what differs; 7 of B has the color of 1 of A."""
    page = draw_comparison(comparison)
    names = [each.text for each in page.shapes if isinstance(each, Text) and each.is_bold]
    assert sorted(names) == ["1", "2", "2", "7", "9"]
    fills = [each for each in page.shapes if isinstance(each, Area) and each.fill == track_color(1)]
    assert len([each for each in fills if each.shape.area]) == 2


def test_two_numbers_of_a_room_are_explained(comparison: LayoutComparison):
    """Where a room that changed is named by both."""
    changed = (dataclasses.replace(comparison.rooms[0], status="changed"), *comparison.rooms[1:])
    page = draw_comparison(dataclasses.replace(comparison, rooms=changed))
    texts = {each.text for each in page.shapes if isinstance(each, Text)}
    assert {"1 > 7", "what differs (A > B: a room's number in A and in B)"} <= texts


def test_b_lies_where_its_motion_brings_it(comparison: LayoutComparison):
    """The pictures of both maps cover the same place of the panel of what differs."""
    page = draw_comparison(comparison)
    faint = [each for each in page.shapes if isinstance(each, Picture) and each.pixels.shape[2] == 4]
    assert len(faint) == 2
    assert faint[0].matrix == pytest.approx(faint[1].matrix)


def test_the_title_warns_where_the_runs_do_not_fit(comparison: LayoutComparison):
    unsure = dataclasses.replace(comparison.placement, runner_up_score=0.95)
    other = dataclasses.replace(comparison.placement, score=0.1, agreement=0.1)
    assert "B may be misaligned" in draw_comparison(dataclasses.replace(comparison, placement=unsure)).title
    assert (
        "do not seem to be two runs"
        in draw_comparison(dataclasses.replace(comparison, placement=other)).title
    )
