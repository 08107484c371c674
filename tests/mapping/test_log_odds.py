import numpy as np
import pytest

from rose2_logs.config.mapping import MappingParameters
from rose2_logs.errors import InvalidMapError
from rose2_logs.mapping.log_odds import Beams, MapBuilder, beams_of


def test_mapped_ray_is_free_up_to_an_occupied_end_and_unknown_beyond():
    builder = MapBuilder()
    builder.add_scan(np.array([0.01, 0.01, 0.0]), np.array([0.0]), np.array([1.0]))
    cells, geometry = builder.trinary(), builder.geometry()
    row, column = geometry.world_to_cell(np.array([0.01, 0.01]))
    assert cells[row, column : column + 20].tolist() == [0] * 20
    assert cells[row, column + 20] == 100
    assert (cells != -1).sum() == 21


def test_rays_past_the_usable_range_mark_no_obstacle_and_lost_rays_mark_nothing():
    builder = MapBuilder(MappingParameters(usable_range_m=2.0))
    builder.add_scan(np.zeros(3), np.array([0.0, 1.0]), np.array([5.0, np.nan]))
    cells = builder.trinary()
    assert not (cells == 100).any()
    assert (cells == 0).sum() == 41


def test_growing_canvas_keeps_what_it_holds_at_its_place_in_the_world():
    builder = MapBuilder()
    builder.add_scan(np.zeros(3), np.array([0.0]), np.array([1.0]))
    before, old = builder.trinary(), builder.geometry()
    builder.add_scan(np.zeros(3), np.array([np.pi * 0.75]), np.array([12.0]))
    after, new = builder.trinary(), builder.geometry()
    assert new.origin_xy_m < old.origin_xy_m
    rows, columns = np.nonzero(before == 100)
    moved = new.world_to_cell(old.cell_centers(rows, columns))
    assert (after[moved[:, 0], moved[:, 1]] == 100).all()


def test_cells_of_a_beam_join_its_ends_without_gaps():
    for end in np.random.default_rng(0).uniform(-2, 2, (50, 2)):
        builder = MapBuilder()
        builder.add(Beams(np.array([0.13, -0.08]), end[None], np.array([False])))
        rows, columns = np.nonzero(builder.trinary() == 0)
        first, last = builder.geometry().world_to_cell(np.array([[0.13, -0.08], end]))
        cells = set(zip(rows.tolist(), columns.tolist(), strict=True))
        assert tuple(first.tolist()) in cells
        assert tuple(last.tolist()) in cells
        assert len(cells) == np.abs(last - first).max() + 1
        for axis in (rows, columns):
            assert np.diff(np.unique(axis)).max(initial=1) == 1


def test_beams_that_start_at_several_places_are_mapped_from_there():
    builder = MapBuilder()
    starts = np.array([[0.01, 0.01], [0.01, 1.01]])
    builder.add(Beams(starts, starts + np.array([1.0, 0.0]), np.array([True, True])))
    cells, geometry = builder.trinary(), builder.geometry()
    for start in starts:
        row, column = geometry.world_to_cell(start)
        assert cells[row, column : column + 21].tolist() == [0] * 20 + [100]
    assert (cells != -1).sum() == 42


def test_a_beam_without_return_is_free_as_far_as_is_said_and_by_default_says_nothing():
    pose, bearings, ranges = np.array([0.01, 0.01, 0.0]), np.array([0.0]), np.array([np.inf])
    silent, told = MapBuilder(), MapBuilder(MappingParameters(no_return_m=3.0))
    for builder in (silent, told):
        builder.add_scan(pose, bearings, ranges)
    assert not silent.trinary().size
    assert (told.trinary() == 0).sum() == 61
    assert not (told.trinary() == 100).any()


def test_a_cell_counts_once_a_scan_and_as_hit_where_any_beam_ends_in_it():
    builder = MapBuilder()
    bearings = np.linspace(-0.001, 0.001, 50)
    builder.add_scan(np.array([0.01, 0.01, 0.0]), bearings, np.r_[[1.0] * 49, 2.0])
    percent, geometry = builder.probabilities(), builder.geometry()
    row, column = geometry.world_to_cell(np.array([1.01, 0.01]))
    assert percent[row, column] == round(100 / (1 + np.exp(-0.9)))
    assert percent[row, column - 3] == round(100 / (1 + np.exp(0.32)))


def test_a_door_that_was_closed_is_free_again_after_few_scans():
    builder = MapBuilder()
    pose, bearings = np.array([0.01, 0.01, 0.0]), np.array([0.0])
    for distance, count in ((1.0, 100), (2.0, 20)):
        for _ in range(count):
            builder.add_scan(pose, bearings, np.array([distance]))
    row, column = builder.geometry().world_to_cell(np.array([1.01, 0.01]))
    assert builder.trinary()[row, column] == 0


def test_a_scan_far_away_is_refused_and_the_map_stays_as_it_was():
    builder = MapBuilder(most_cells=100_000)
    builder.add_scan(np.zeros(3), np.array([0.0]), np.array([1.0]))
    before = builder.trinary()
    with pytest.raises(InvalidMapError, match=r"raise the parameter reading\.map_max_cells"):
        builder.add_scan(np.array([1e6, 0, 0]), np.array([0.0]), np.array([1.0]))
    assert np.array_equal(builder.trinary(), before)


def test_unknown_ranges_are_left_out_and_long_ones_end_free():
    ranges = np.array([np.nan, -1.0, 0.0, 5.0, 30.0])
    directions = np.tile([1.0, 0.0], (5, 1))
    beams = beams_of(np.zeros(2), directions, ranges, MappingParameters())
    assert beams.ends_m[:, 0].tolist() == [5.0, 20.0]
    assert beams.returned.tolist() == [True, False]
