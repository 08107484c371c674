"""Stage D: rooms whose free space falls apart are split."""

import numpy as np
import pytest

from rose2_logs.config.topology import TopologyParameters
from rose2_logs.model.labels import distance_from
from rose2_logs.segmentation.topology import voronoi
from rose2_logs.segmentation.topology.splitting import split_rooms
from rose2_logs.segmentation.topology.voronoi import clearance_m, parts_of_room, voronoi_lines

PARAMETERS = TopologyParameters()
NO_LINES = np.zeros((0, 4))
AXES = np.array([0.0, np.pi / 2])


def dumbbell():
    """One label over two rooms of 4 x 3 m that a gap of 0.3 m connects."""
    walls = np.zeros((100, 170), bool)
    walls[:, 84:86] = True
    walls[47:53, 84:86] = False
    labels = np.where(walls, 0, 1).astype(np.int32)
    return labels, walls


def test_a_room_that_only_a_narrow_gap_holds_together_is_split_along_a_dominant_direction():
    labels, walls = dumbbell()
    split = split_rooms(labels, distance_from(walls), NO_LINES, AXES, 0.05, PARAMETERS)
    assert len(np.unique(split[split > 0])) == 2
    assert len(np.unique(split[:, :80])) == len(np.unique(split[:, 90:])) == 1


def test_a_representative_line_that_divides_the_parts_is_where_the_cut_goes():
    labels, walls = dumbbell()
    line = np.array([(4.3, 0.0, 4.3, 5.0)])
    split = split_rooms(labels, distance_from(walls), line, AXES, 0.05, PARAMETERS)
    columns = np.flatnonzero(split[50, :-1] != split[50, 1:])
    assert columns.tolist() == [85]


def test_of_several_lines_the_one_that_keeps_the_parts_apart_best_is_the_cut():
    labels, walls = dumbbell()
    best, crossing, along = (4.3, 0.0, 4.3, 5.0), (1.0, 0.0, 7.0, 5.0), (0.0, 2.5, 8.5, 2.5)
    for lines in ([best, crossing, along], [along, crossing, best]):
        split = split_rooms(labels, distance_from(walls), np.array(lines), AXES, 0.05, PARAMETERS)
        assert np.flatnonzero(split[20, :-1] != split[20, 1:]).tolist() == [83, 85]
        assert np.flatnonzero(split[50, :-1] != split[50, 1:]).tolist() == [85]
        assert len(np.unique(split[:, :84])) == 1


def test_a_room_in_one_piece_stays_whole():
    labels = np.ones((80, 80), np.int32)
    split = split_rooms(labels, distance_from(np.zeros((80, 80), bool)), NO_LINES, AXES, 0.05, PARAMETERS)
    assert (split == labels).all()


def test_the_drawn_voronoi_graph_is_a_straight_line_in_a_corridor_and_goes_through_doors():
    """Two corridors of 1 m that a gap of 0.5 m connects: one line along each, joined by the gap."""
    walls = np.ones((60, 200), bool)
    walls[5:25] = walls[35:55] = False
    walls[25:35, 100:110] = False
    lines = voronoi_lines(~walls, walls, 0.05, PARAMETERS)
    lengths = np.hypot(*(lines[:, 2:] - lines[:, :2]).T)
    in_corridors = lines[lengths > 1.5]
    assert len(in_corridors) >= 2
    for y in (in_corridors[:, 1], in_corridors[:, 3]):
        assert np.minimum(np.abs(y - 0.75), np.abs(y - 2.25)).max() <= 0.1
    # What crosses the wall between them does so in the gap.
    crossing = lines[(lines[:, [1, 3]].min(axis=1) < 1.6) & (lines[:, [1, 3]].max(axis=1) > 1.4)]
    assert len(crossing)
    assert np.abs(crossing[:, [0, 2]] - 5.25).max() < 0.3
    assert len(voronoi_lines(np.zeros((5, 5), bool), np.ones((5, 5), bool), 0.05, PARAMETERS)) == 0


def parts(walls):
    """Parts of all cells that are no wall, as one room."""
    return parts_of_room(~walls, clearance_m(distance_from(walls), 0.05, 1.0), 0.05, PARAMETERS)


def test_a_narrow_gap_divides_the_parts_of_a_room_and_a_wide_one_does_not():
    _, walls = dumbbell()
    part = parts(walls)
    assert sorted(np.unique(part)) == [0, 1, 2]
    assert ((part > 0) == ~walls).all()
    walls[20:80, 84:86] = False
    assert parts(walls) is None


def test_two_halls_stay_two_though_the_corridor_between_them_opens_to_both():
    """What the corridor joined is as wide as its hall, so that it is no wide way on to the other one."""
    walls = np.ones((140, 360), bool)
    walls[5:135, 5:135] = walls[5:135, 225:355] = walls[60:80, 135:225] = False
    part = parts(walls)
    assert part[70, 70] != part[70, 290]
    assert len(np.unique(part[part > 0])) == 2


def test_a_niche_is_no_part():
    walls = np.zeros((100, 200), bool)
    walls[:20] = True
    walls[5:20, 40:60] = walls[20, 48:52] = False  # a niche of 1 x 0.75 m with a mouth of 0.2 m
    walls[19, :48] = walls[19, 52:] = True
    assert parts(walls) is None


def test_pieces_of_a_room_that_do_not_touch_are_parts():
    """Two pieces of one room, side by side in the open, with a strip of another room between them."""
    inside = np.ones((60, 130), bool)
    inside[:, 60:70] = False
    clear = np.full(inside.shape, 2.0, np.float32)
    part = parts_of_room(inside, clear, 0.05, PARAMETERS)
    assert np.unique(part[:, :60]).tolist() != np.unique(part[:, 70:]).tolist()
    assert ((part > 0) == inside).all()


def test_a_room_of_three_parts_is_split_twice_and_its_neighbor_not_at_all():
    walls = np.zeros((100, 300), bool)
    walls[:, 84:86] = walls[:, 184:186] = walls[:, 270] = True
    walls[47:53, 84:86] = walls[47:53, 184:186] = False
    labels = np.where(walls, 0, 1).astype(np.int32)
    labels[:, 271:] = 2
    split = split_rooms(labels, distance_from(walls), NO_LINES, AXES, 0.05, PARAMETERS)
    assert len({int(split[20, column]) for column in (40, 130, 230)}) == 3
    assert (split[:, 271:] == 2).all()
    assert len(np.unique(split[split > 0])) == 4


def test_a_line_that_ends_before_a_room_does_not_divide_it():
    labels, walls = dumbbell()
    beside, away = (4.3, 0.0, 4.3, 5.0), (4.35, 20.0, 4.35, 30.0)
    for lines in ([beside], [beside, away]):
        split = split_rooms(labels, distance_from(walls), np.array(lines), AXES, 0.05, PARAMETERS)
        assert np.flatnonzero(split[50, :-1] != split[50, 1:]).tolist() == [85]
    alone = split_rooms(labels, distance_from(walls), np.array([away]), AXES, 0.05, PARAMETERS)
    assert (alone == split_rooms(labels, distance_from(walls), NO_LINES, AXES, 0.05, PARAMETERS)).all()


@pytest.mark.parametrize("change", [np.fliplr, np.flipud, np.rot90])
def test_the_parts_of_a_mirrored_or_turned_map_are_the_same(change):
    _, walls = dumbbell()
    part, changed = parts(walls), parts(np.ascontiguousarray(change(walls)))
    pairs = np.unique(np.column_stack([change(part).ravel(), changed.ravel()]), axis=0)
    assert len(pairs) == 3


def test_what_is_seen_to_be_one_part_beforehand_would_be_one_after_dividing_it_as_well(monkeypatch):
    """Floors with walls and pillars at random: dividing them gives no second part large enough."""
    parameters = TopologyParameters(split_min_area_m2=1.0, split_min_clearance_m=0.3)

    def large_parts(inside, clear):
        part = parts_of_room(inside, clear, 0.05, parameters)
        part = inside if part is None else part
        return int((np.bincount(part.ravel())[1:] * 0.05**2 >= parameters.split_min_area_m2).sum())

    floors = []
    for seed in range(40):
        draw = np.random.default_rng(seed)
        walls = draw.random((120, 140)) < 0.001
        for _ in range(7):
            along, first, length = draw.integers((0, 0, 10), (118, 100, 80))
            window = (slice(along, along + 2), slice(first, first + length))
            walls[window[:: draw.choice([1, -1])]] = True
        floors.append((~walls, clearance_m(distance_from(walls), 0.05, 1.0)))
    quickly = [large_parts(*floor) for floor in floors]
    monkeypatch.setattr(voronoi, "_will_join", lambda *_: False)
    divided = [large_parts(*floor) for floor in floors]
    assert divided == quickly
    assert 5 < divided.count(1) < 35  # some of both kinds
