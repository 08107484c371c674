"""Stage B: segments, wall clusters, representative lines."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rose2_logs.config.parameters import WallParameters
from rose2_logs.segmentation.walls.clusters import cluster_segments, covered_length, weighted_median
from rose2_logs.segmentation.walls.lines import representative_lines
from rose2_logs.segmentation.walls.segments import Segments, detect_segments, local_directions
from rose2_logs.segmentation.walls.strips import WallCells

PARAMETERS = WallParameters()
DIRECTIONS = np.array([0.0, np.pi / 2])


def axis_aligned(ends):
    ends = np.array(ends, float)
    direction = (ends[:, 0] == ends[:, 2]).astype(np.int32)
    # Across is the direction turned by a quarter: y for lines along x, -x for lines along y.
    offset = np.where(direction == 1, -ends[:, 0], ends[:, 1])
    along = np.where(direction == 1, ends[:, 1::2].T, ends[:, ::2].T)
    return Segments(DIRECTIONS, direction, offset, along.min(0), along.max(0))


def lines_of(ends):
    segments = axis_aligned(ends)
    clusters = cluster_segments(segments, PARAMETERS)
    return representative_lines(clusters, DIRECTIONS, len(DIRECTIONS), PARAMETERS), clusters


intervals = st.lists(st.tuples(st.integers(0, 2), st.integers(0, 30), st.integers(1, 9)), min_size=1)


@given(intervals)
def test_covered_length_is_that_of_the_union(found):
    group, start, length = (np.array(part) for part in zip(*found, strict=True))
    covered = covered_length(start.astype(float), (start + length).astype(float), group, 3)
    for number in range(3):
        cells = {x for g, s, n in found if g == number for x in range(s, s + n)}
        assert np.isclose(covered[number], len(cells))


@given(st.lists(st.tuples(st.integers(-5, 5), st.integers(1, 4)), min_size=1))
def test_the_weighted_median_is_that_of_repeated_values(found):
    values, weights = (np.array(part, float) for part in zip(*found, strict=True))
    repeated = np.sort(np.repeat(values, weights.astype(int)))
    median = weighted_median(values, weights, np.zeros(len(values), int), 1)[0]
    assert median == repeated[(len(repeated) - 1) // 2]


def test_a_wall_with_a_door_is_one_line():
    lines, _ = lines_of([(0, 1, 4, 1), (4.9, 1.02, 9, 1.02)])
    assert len(lines.ends_m) == 1
    assert lines.weight[0] > PARAMETERS.line_min_weight


def test_both_faces_of_a_wall_share_a_line_and_walls_of_two_rooms_do_not():
    assert len(lines_of([(0, 1, 4, 1), (0, 1.2, 4, 1.2)])[0].ends_m) == 1
    assert len(lines_of([(0, 1, 4, 1), (0, 3, 4, 3)])[0].ends_m) == 2


def test_a_line_reaches_beyond_its_wall_and_every_segment_knows_its_line():
    lines, clusters = lines_of([(2, 0, 2, 5), (0, 3, 3, 3)])
    assert (clusters.of_segment >= 0).all()
    assert sorted(lines.of_cluster.tolist()) == [0, 1]
    lengths = np.hypot(*(lines.ends_m[:, 2:] - lines.ends_m[:, :2]).T)
    assert (lengths > 5).all()


@pytest.mark.parametrize(("share_of_gap", "walls"), [(0.9, 1), (1.1, 2), (1.9, 2)])
def test_segments_farther_apart_than_furniture_before_a_wall_are_two_walls(share_of_gap, walls):
    start = 4 + share_of_gap * PARAMETERS.cluster_gap_m
    _, clusters = lines_of([(0, 1, 4, 1), (start, 1, start + 4, 1)])
    assert len(clusters.offset) == walls


@pytest.mark.parametrize("length_m", [0.5, 1.0, 5.0])
def test_a_short_wall_reaches_less_far(length_m):
    """In proportion to itself, and no wall farther than a room."""
    lines, _ = lines_of([(0, 1, length_m, 1)])
    reach = min(PARAMETERS.extension_m, PARAMETERS.extension_per_length * length_m)
    np.testing.assert_allclose(np.sort(lines.ends_m[0, ::2]), [-reach, length_m + reach])


def test_segments_have_the_ends_that_they_were_made_of():
    ends = [(0.0, 1.0, 4.0, 1.0), (2.0, -1.0, 2.0, 5.0)]
    assert np.allclose(axis_aligned(ends).ends_m, ends)


def drawn(*cells):
    clean = np.zeros((120, 200), bool)
    for rows, columns in cells:
        clean[rows, columns] = True
    return clean


def segments_of(clean, directions=DIRECTIONS, least=0.4):
    return detect_segments(WallCells(clean, directions, 0.05), clean, least, PARAMETERS)


def test_segments_of_a_drawn_wall_cover_it():
    segments, members = segments_of(drawn((slice(40, 42), slice(20, 180))))
    assert (segments.direction == 0).all()
    assert segments.start.min() == pytest.approx(1.0, abs=1e-6)
    assert segments.end.max() == pytest.approx(9.0, abs=1e-6)
    assert np.allclose(segments.offset, 2.05, atol=0.05)
    assert members.sum() == 2 * 160
    assert len(segments_of(np.zeros((10, 10), bool))[0].offset) == 0


def test_along_no_direction_there_are_no_segments():
    segments, members = segments_of(drawn((slice(40, 42), slice(20, 180))), directions=np.zeros(0))
    assert len(segments.offset) == 0
    assert not members.any()


def test_a_thick_wall_has_no_segments_across_it():
    segments, _ = segments_of(drawn((slice(40, 50), slice(20, 180))))
    assert (segments.direction == 0).all()


def test_a_corner_has_segments_of_both_directions():
    segments, _ = segments_of(drawn((slice(20, 22), slice(20, 100)), (slice(20, 100), slice(20, 22))))
    assert set(segments.direction.tolist()) == {0, 1}


def test_a_gap_of_a_door_ends_a_segment_and_short_rows_are_none():
    wall = drawn((40, slice(20, 60)), (40, slice(78, 120)), (80, slice(20, 26)))
    segments, _ = segments_of(wall)
    assert np.unique(np.round(segments.end - segments.start, 6)).tolist() == [2.0, 2.1]


def test_scattered_cells_are_no_segment():
    clean = drawn((40, slice(20, 180, 5)))
    assert len(segments_of(clean)[0].offset) == 0


@pytest.mark.parametrize("change", [np.fliplr, np.flipud, lambda image: np.rot90(image, 2)])
def test_a_mirrored_map_has_the_mirrored_walls(change):
    rng = np.random.default_rng(3)
    clean = drawn((slice(40, 43), slice(20, 180)), (slice(10, 110), slice(90, 92)))
    clean &= rng.random(clean.shape) < 0.9
    _, members = segments_of(clean)
    _, changed = segments_of(change(clean))
    assert (change(changed) == members).mean() > 0.999


def test_a_slanted_wall_is_found_along_a_local_direction():
    clean = np.zeros((120, 200), bool)
    step = np.arange(0, 100)
    clean[10 + step, 20 + step] = clean[10 + step, 21 + step] = True
    local = local_directions(DIRECTIONS, PARAMETERS)
    assert np.abs(local[:, None] - DIRECTIONS).min() > PARAMETERS.direction_tolerance_rad
    segments, members = segments_of(clean, local, PARAMETERS.local_segment_min_length_m)
    assert members.sum() > 0.9 * clean.sum()
    chosen = segments.directions_rad[segments.direction]
    assert np.abs(chosen - np.pi / 4).max() <= PARAMETERS.local_direction_step_rad
