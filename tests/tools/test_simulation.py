import json

import numpy as np
import pytest
import shapely
from PIL import Image


def room_of_four_walls(transmission=0.0):
    """A square room of 4 m around the origin, with a thing 2 m behind its right wall."""
    from simulation.building import Building, Room

    room = shapely.box(-2, -2, 2, 2)
    walls = np.array([[-2, -2, 2, -2], [2, 2, -2, 2], [-2, 2, -2, -2], [2, -2, 2, 2], [4, -9, 4, 9]], float)
    passing = np.array([0, 0, 0, transmission, 0])
    return Building("square", (Room(1, "room 1", room),), (), shapely.Point(), walls, passing, (0.0, 0.0))


def exact_lidar():
    from simulation.lidar import Lidar

    return Lidar(beams=5, field_of_view_rad=np.pi, range_noise_m=0, dropout=0, mixed=0, speckle=0)


def test_same_seed_makes_the_same_building_and_another_seed_another():
    from simulation.make_building import simulate_building

    first, again, other = (simulate_building(seed, "bent") for seed in (3, 3, 4))
    assert np.array_equal(first.segments, again.segments)
    assert first.segments.shape != other.segments.shape or not np.allclose(first.segments, other.segments)


@pytest.mark.parametrize("style", ["straight", "bent", "ring", "hall", "flat", "campus"])
def test_rooms_of_every_style_are_whole_apart_and_reachable(style):
    from simulation.make_building import simulate_building

    building = simulate_building(11, style)
    polygons = [room.polygon for room in building.rooms]
    assert all(polygon.is_valid and polygon.area > 2 for polygon in polygons)
    assert [room.number for room in building.rooms] == list(range(1, len(polygons) + 1))
    overlap = sum(p.area for p in polygons) - shapely.union_all(polygons).area
    assert overlap < 1e-6
    joined, pairs = {1}, building.doorway_rooms
    for _ in pairs:
        joined |= {room for pair in pairs if joined & set(pair) for room in pair}
    assert joined == {room.number for room in building.rooms}


def test_unknown_style_is_refused_with_the_list_of_styles():
    from simulation.make_building import simulate_building

    with pytest.raises(ValueError, match="straight, bent"):
        simulate_building(1, "castle")


def test_ranges_are_the_distances_to_the_walls():
    ranges = exact_lidar().scan(room_of_four_walls(), np.zeros(3), np.random.default_rng(0))
    diagonal = 2 * np.sqrt(2)
    assert np.allclose(ranges, [2, diagonal, 2, diagonal, 2], atol=1e-9)


def test_rays_through_clear_glass_reach_what_is_behind():
    ranges = exact_lidar().scan(room_of_four_walls(transmission=1.0), np.zeros(3), np.random.default_rng(0))
    assert ranges[2] == pytest.approx(4)
    assert ranges[0] == pytest.approx(2)


def test_exploration_sees_almost_the_whole_floor_and_its_maps_grow(flat, flat_run):
    free = [(step.cells == 0).sum() for step in flat_run]
    assert free[0] < 0.8 * free[-1]
    last = flat_run[-1]
    assert last.last
    labels, origin = flat.room_labels(0.05)
    rows, columns = np.nonzero(labels)
    xy = (np.stack([columns, rows], -1) + 0.5) * 0.05 + np.array(origin)
    cells = last.geometry.world_to_cell(xy)
    inside = ((cells >= 0) & (cells < last.cells.shape)).all(1)
    known = np.zeros(len(xy), bool)
    known[inside] = last.cells[cells[inside, 0], cells[inside, 1]] >= 0
    assert known.mean() > 0.8


def test_a_run_repeats_exactly_and_its_times_ascend(flat, flat_run):
    from simulation.exploration import explore

    again = list(explore(flat, 6, map_every_s=10.0))
    assert len(again) == len(flat_run)
    assert all(np.array_equal(a.cells, b.cells) for a, b in zip(again, flat_run, strict=True))
    assert all(np.array_equal(a.percent, b.percent) for a, b in zip(again, flat_run, strict=True))
    times = [time for step in flat_run for time in [*(pose.time_s for pose in step.poses), step.time_s]]
    assert times == sorted(times)


def test_robot_never_stands_in_a_wall_or_in_furniture(flat, flat_run):
    floor = flat.walkable(0.1)
    places = np.array([pose.truth[:2] for step in flat_run for pose in step.poses])
    assert shapely.contains_xy(floor, places[:, 0], places[:, 1]).all()


def test_truth_labels_free_cells_of_rooms_only_and_no_tiny_room(flat, flat_run):
    from simulation.truth import MIN_ROOM_CELLS, true_labels

    step = flat_run[-1]
    labels = true_labels(flat, step.cells, step.geometry)
    assert (step.cells[labels > 0] == 0).all()
    assert np.unique(labels[labels > 0], return_counts=True)[1].min() > MIN_ROOM_CELLS
    rows, columns = np.nonzero((step.cells == 0) & (labels == 0))
    xy = step.geometry.cell_centers(rows, columns)
    # What has no label is outside, or a room of a few cells.
    depth = shapely.union_all([room.polygon for room in flat.rooms]).buffer(-0.05)
    assert shapely.contains_xy(depth, xy[:, 0], xy[:, 1]).sum() <= MIN_ROOM_CELLS
    for room in flat.rooms:
        own = np.nonzero(labels == room.number)
        points = step.geometry.cell_centers(*own)
        assert shapely.contains_xy(room.polygon.buffer(0.3), points[:, 0], points[:, 1]).all()


def test_static_cases_have_the_form_of_the_benchmark(tmp_path):
    from make_sample_logs import main

    assert main(["--cases", str(tmp_path), "--count", "1", "--seed", "6", "--style", "flat"]) == 0
    cases = json.loads((tmp_path / "cases.json").read_text())["cases"]
    assert {case["group"] for case in cases} == {"simulated_full", "simulated_partial"}
    for case in cases:
        gray, rooms = (np.asarray(Image.open(tmp_path / case[key])) for key in ("map", "rooms"))
        assert list(gray.shape) == list(rooms.shape) == case["shape"]
        assert set(np.unique(gray)) <= {0, 205, 254}
        assert np.unique(rooms).tolist() == list(range(case["n_rooms"] + 1))
        assert (gray[rooms > 0] == 254).all()
        assert case["free"] == (gray == 254).sum()


def test_runs_are_cases_in_their_order_with_origins(tmp_path):
    from make_sample_logs import main

    assert main(["--runs", str(tmp_path), "--count", "1", "--seed", "8", "--style", "flat"]) == 0
    cases = json.loads((tmp_path / "cases.json").read_text())["cases"]
    assert {case["group"] for case in cases} == {"run_flat_8"}
    assert [case["name"] for case in cases] == [f"map{index:02d}" for index in range(len(cases))]
    assert len(cases) > 10
    assert cases[0]["free"] < 0.9 * cases[-1]["free"]
    assert all(len(case["origin_xy_m"]) == 2 for case in cases)
