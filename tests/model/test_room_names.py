"""Names reach the rooms that they are of; kinds are guessed from outlines."""

from __future__ import annotations

import pytest
import shapely

from rose2_logs.config.kinds import KindParameters
from rose2_logs.model.room_kinds import guess_kinds
from rose2_logs.model.room_names import RoomNames

LEFT, RIGHT = shapely.box(0, 0, 4, 3), shapely.box(4, 0, 8, 3)


def test_points_and_outlines_name_the_rooms_that_hold_them():
    """A track's name comes first; a room that holds several is called by all of them."""
    points = (shapely.Point(1, 1), shapely.Point(3, 2), shapely.Point(50, 1), shapely.box(4.2, 0.2, 7, 2.8))
    names = RoomNames({}, points, ("Kitchen", "Pantry", "Nowhere", "Hall"))
    found = names.of((1, 2), (LEFT, RIGHT))
    assert found == ("Kitchen + Pantry", "Hall")
    assert names.unused(found, (1, 2)) == ["Nowhere"]
    both = RoomNames({1: "Office", 9: "Gone"}, points, names.of_place)
    assert both.of((1, 2), (LEFT, RIGHT)) == ("Office", "Hall")
    assert both.unused(("Office", "Hall"), (1, 2)) == ["Gone", "Kitchen", "Nowhere", "Pantry"]


def test_a_name_with_a_plus_is_used():
    names = RoomNames({}, (shapely.Point(1, 1),), ("Lab + Office",))
    assert names.unused(names.of((1,), (LEFT,)), (1,)) == []


def test_an_outline_that_reaches_a_little_into_a_room_does_not_name_it():
    names = RoomNames({}, (shapely.box(0, 0, 4.5, 3),), ("Kitchen",))
    assert names.of((1, 2), (LEFT, RIGHT)) == ("Kitchen", "")


@pytest.mark.parametrize(
    ("shape", "kind"),
    [
        (shapely.box(0, 0, 20, 2), "corridor"),
        (shapely.union(shapely.box(0, 0, 12, 2), shapely.box(10, 0, 12, 12)), "corridor"),
        (shapely.box(0, 0, 30, 20).difference(shapely.box(2, 2, 28, 18)), "corridor"),
        (shapely.box(0, 0, 30, 8), "hall"),
        (shapely.box(0, 0, 12, 9).difference(shapely.box(3, 3, 7, 5)), "hall"),
        (shapely.union(shapely.box(0, 0, 5, 9), shapely.box(0, 0, 9, 5)), "room"),
        (shapely.box(0, 0, 4, 0.6), "closet"),
        (shapely.box(0, 0, 5, 4), "room"),
        (shapely.box(0, 0, 1.5, 1.2), "closet"),
        (shapely.Polygon(), ""),
    ],
    ids=["straight", "bent", "ring", "wide", "furnished", "bent and wide", "gap", "square", "small", "empty"],
)
def test_kinds_are_guessed_from_shapes(shape, kind):
    """Whatever the turn of the map, and however ragged the outline is by furniture."""
    turned = shapely.affinity.rotate(shape, 33, origin=(0, 0))
    beside = shapely.box(0, 0, 3, 3), shapely.Polygon()
    assert guess_kinds([beside[0], turned, beside[1]], KindParameters()) == ["room", kind, ""]
    if kind == "room":
        teeth = shapely.union_all([shapely.box(x, 3.4, x + 0.3, 4) for x in (0.5, 1.3, 2.1, 2.9, 3.7)])
        assert guess_kinds([shapely.difference(shape, teeth)], KindParameters()) == [kind]


@pytest.mark.filterwarnings("error")
def test_a_shape_at_whose_corners_geos_divides_by_zero_has_a_kind_and_no_warning():
    points = [(0.1, 0.1), (0.2, 0.0), (0.15, 0.15), (0.15, 0.05), (0.15, 0.05)]
    exact = [(x, 0.15000000000000002 if y == 0.15 else y) for x, y in points]
    exact = [(0.15000000000000002 if x == 0.15 else x, y) for x, y in exact]
    assert len(guess_kinds([shapely.Polygon(exact)], KindParameters())) == 1
