"""Stage B: segments, wall clusters, representative lines."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from rose2_logs.parameters import WallParameters
from rose2_logs.walls.clusters import cluster_segments, covered_length, weighted_median
from rose2_logs.walls.lines import representative_lines
from rose2_logs.walls.segments import detect_segments, group_by_angle

PARAMETERS = WallParameters()
DIRECTIONS = np.array([0.0, np.pi / 2])


def lines_of(segments):
    segments = np.array(segments, float)
    directions, direction = group_by_angle(segments, DIRECTIONS, PARAMETERS)
    clusters = cluster_segments(segments, directions, direction, PARAMETERS)
    return representative_lines(clusters, directions, len(DIRECTIONS), PARAMETERS), clusters


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


def test_a_slanted_wall_gets_a_direction_of_its_own():
    segments = np.array([(0, 0, 5, 0), (0, 0, 3, 3)], float)
    directions, direction = group_by_angle(segments, DIRECTIONS, PARAMETERS)
    assert direction[0] == 0
    assert abs(directions[direction[1]] - np.pi / 4) <= PARAMETERS.local_direction_step_rad / 2 + 1e-9


def test_segments_of_a_drawn_wall_cover_it():
    clean = np.zeros((100, 200), bool)
    clean[40:42, 20:180] = True
    segments = detect_segments(clean, 0.05, PARAMETERS)
    assert segments[:, [0, 2]].min() < 1.2
    assert segments[:, [0, 2]].max() > 8.8
    assert np.allclose(segments[:, [1, 3]], 2.05, atol=0.1)
    assert len(detect_segments(np.zeros((10, 10), bool), 0.05, PARAMETERS)) == 0
