"""What lies between neighboring rooms: a wall, a door, an opening, and how sure it is."""

from __future__ import annotations

import numpy as np
import pytest
from drawn_maps import office, snapshot

import rose2_logs as rl
from rose2_logs.segmentation.rooms.doorways import borders_between

DOOR_M = 1.4


def doorway(one: int, other: int, width_m: float) -> rl.Doorway:
    return rl.Doorway((one, other), np.array([[0.0, 0.0], [width_m, 0.0]]))


def between(doorways, strengths, regions=(1, 2, 3), areas=(9.0, 5.0, 4.0)) -> tuple[rl.Border, ...]:
    of_room = np.array([0, *regions], np.int32)
    return borders_between(doorways, strengths, of_room, np.array(areas), DOOR_M)


def test_a_border_is_what_its_widest_doorway_is():
    """Without any it is a wall; from just above the width of a door on it is an opening."""
    strengths = {(1, 2): 0.9, (1, 3): 0.7, (2, 3): 1.0}
    doorways = [doorway(1, 2, 0.8), doorway(1, 2, DOOR_M), doorway(1, 3, DOOR_M + 0.01)]
    assert between(doorways, strengths) == (
        rl.Border((1, 2), "door", DOOR_M, 0.9),
        rl.Border((1, 3), "opening", DOOR_M + 0.01, 0.7),
        rl.Border((2, 3), "wall", 0.0, 1.0),
    )


def test_rooms_that_are_no_neighbors_have_no_border():
    assert between([], {(1, 2): 0.9}) == (rl.Border((1, 2), "wall", 0.0, 0.9),)


def test_pieces_of_a_region_have_its_strength_where_there_is_a_doorway():
    """Where there is none the largest piece stands for the region."""
    found = between([doorway(1, 3, 0.9)], {(4, 7): 0.6}, regions=(7, 7, 4), areas=(2.0, 5.0, 4.0))
    assert found == (rl.Border((1, 3), "door", 0.9, 0.6), rl.Border((2, 3), "wall", 0.0, 0.6))


def test_a_region_that_was_too_small_for_a_room_has_no_border():
    assert between([], {(1, 9): 0.9, (8, 9): 1.0}) == ()


@pytest.mark.parametrize(("strength", "unsure"), [(0.799, True), (0.8, False)])
def test_a_border_is_unsure_below_a_strength(strength: float, unsure: bool):
    assert rl.Border((1, 2), "door", 0.9, strength).is_unsure is unsure


def test_a_drawn_office_has_its_doors_and_its_wall():
    """Two rooms above a corridor, a door from each to it, a wall between them."""
    cells, true = office(turn_rad=0.3)
    found = rl.segment(snapshot(cells))
    name = {int(np.bincount(found.labels[true == number]).argmax()): number for number in (1, 2, 3)}
    kinds = {tuple(sorted(name[room] for room in each.rooms)): each for each in found.borders}
    assert {pair: each.kind for pair, each in kinds.items()} == {
        (1, 3): "door",
        (2, 3): "door",
        (1, 2): "wall",
    }
    assert kinds[1, 3].width_m == pytest.approx(0.8, abs=0.2)
    assert kinds[1, 2].width_m == 0
    assert all(0 < each.strength <= 1 for each in found.borders)


def test_methods_without_a_fitted_strength_have_no_borders():
    assert rl.segment(snapshot(office()[0]), parameters={"floor_plan.grouping": "walls"}).borders == ()
