"""What the numbers in the cells of a run mean is decided from the run itself."""

import numpy as np
import pytest
from PIL import Image
from reader_logs import SHARED, START_NS, Map, McapLog, Update

from rose2_logs.config.parameters import OccupancyParameters, Parameters
from rose2_logs.errors import ParameterError
from rose2_logs.io import open_log
from rose2_logs.io.cell_values import STORED, count_values, decide, few_walls, oddity
from rose2_logs.model.occupancy import GridGeometry, OccupancySnapshot
from rose2_logs.system.warnings import StrictError, collect_warnings


def building(seen_columns=120):
    """Two rooms as most maps show them: -1, 0, 100."""
    cells = np.full((80, 120), -1, np.int8)
    for left in (5, 60):
        cells[5:75, left : left + 56] = 100
        cells[7:73, left + 2 : left + 54] = 0
    cells[35:45, 58:64] = 0
    cells[:, seen_columns:] = -1
    return cells


def probabilities(cells, share_unsure, lowest_wall=68, seed=0):
    """The same as probabilities, in which some of the free cells are not sure to be free."""
    random = np.random.default_rng(seed)
    free, wall = cells == 0, cells == 100
    unsure = free & (random.random(cells.shape) < share_unsure)
    found = cells.copy()
    found[free] = random.integers(3, 19, free.sum())
    found[unsure] = random.integers(20, 46, unsure.sum())
    found[wall] = random.integers(lowest_wall, 96, wall.sum())
    return found


def changed(cells, **to):
    """The same with other numbers for unknown, free and wall."""
    found = cells.copy().astype(np.int16)
    for name, number in to.items():
        found[cells == {"unknown": -1, "free": 0, "wall": 100}[name]] = number
    return found.astype(np.uint8).view(np.int8)


def log_of(path, *maps, topic="/map"):
    log = McapLog(path)
    for k, cells in enumerate(maps):
        log.add(topic, START_NS + k * 10**10, Map(cells))
    return log.close()


def read(path, **occupancy):
    parameters = OccupancyParameters(**occupancy)
    with open_log(path, occupancy=parameters) as reader, collect_warnings() as found:
        cells = [each.cells for each in reader.snapshots()]
    return cells, found


def kinds_of(cells):
    """-1, 0 or 100 as the usual thresholds tell."""
    return np.where(cells > 65, 100, np.where((cells >= 0) & (cells < 19.6), 0, -1))


STORED_AS = {
    "few unsure": lambda cells: probabilities(cells, 0.3),
    "half unsure": lambda cells: probabilities(cells, 0.5),
    "most unsure": lambda cells: probabilities(cells, 0.9),
    "all unsure": lambda cells: probabilities(cells, 1.0),
    "walls unsure as well": lambda cells: probabilities(cells, 0.5, lowest_wall=55),
    "zero and one": lambda cells: changed(cells, wall=1),
    "fifty is unknown": lambda cells: changed(cells, unknown=50),
    "probabilities, fifty is unknown": lambda cells: np.where(
        cells == -1, np.int8(50), probabilities(cells, 0.5)
    ),
    "forty-nine is unknown": lambda cells: changed(cells, unknown=49),
    "fifty-one is unknown": lambda cells: changed(cells, unknown=51),
    "zero and one, fifty is unknown": lambda cells: changed(cells, wall=1, unknown=50),
    "costs": lambda cells: changed(cells, wall=254),
    "faint walls": lambda cells: changed(cells, wall=40),
    "walls just above one half": lambda cells: changed(cells, wall=58),
}


@pytest.mark.parametrize("name", STORED_AS)
def test_numbers_of_every_kind_become_the_building_that_they_show_and_it_is_told(name, tmp_path):
    maps = [building(40), building(80), building()]
    path = log_of(tmp_path / "run.mcap", *map(STORED_AS[name], maps))
    found, warning_log = read(path)
    for cells, right in zip(found, maps, strict=True):
        np.testing.assert_array_equal(kinds_of(cells), right)
    (told,) = warning_log.kinds["values"].first
    assert "occupancy.values=stored" in told["message"]
    assert warning_log.kinds["values"].count == 1
    with pytest.raises(StrictError), collect_warnings(strict=True), open_log(path) as reader:
        list(reader.snapshots())


@pytest.mark.parametrize("name", STORED_AS)
def test_nothing_is_decided_where_thresholds_or_a_reading_were_named(name, tmp_path):
    stored = STORED_AS[name](building())
    path = log_of(tmp_path / "run.mcap", stored)
    for given in ({"values": "stored"}, {"free_max_percent": 30.0}, {"values": "percent"}):
        (cells,), warning_log = read(path, **given)
        assert "values" not in warning_log.kinds
        in_range = (stored >= -1) & (stored <= 100)
        np.testing.assert_array_equal(cells, np.where(in_range, stored, -1))


@pytest.mark.parametrize(
    ("name", "values"),
    [("zero and one", "zero_one"), ("fifty is unknown", "fifty_unknown"), ("costs", "costs")],
)
def test_a_reading_that_was_named_is_taken_without_a_word(name, values, tmp_path):
    path = log_of(tmp_path / "run.mcap", STORED_AS[name](building()))
    (cells,), warning_log = read(path, values=values)
    np.testing.assert_array_equal(cells, building())
    assert not warning_log.kinds


def inflated(cells):
    """A costmap as nav2 publishes it: costs fall off from the walls."""
    import cv2

    distance = cv2.distanceTransform((cells != 100).astype(np.uint8), cv2.DIST_L2, 5) * 0.05
    costs = np.where(distance <= 0.2, 99, np.exp(-3 * (distance - 0.2)) * 98).astype(np.int8)
    costs[distance > 0.55] = 0
    costs[cells == 100] = 100
    costs[cells == -1] = -1
    return costs


def test_maps_that_the_usual_thresholds_fit_stay_as_they_are():
    random = np.random.default_rng(1)
    for cells in (
        building(),
        inflated(building()),
        probabilities(building(), 0.12),
        random.integers(-1, 101, (80, 120)).astype(np.int8),
        np.full((80, 120), -1, np.int8),
        np.zeros((80, 120), np.int8),
        np.full((80, 120), 100, np.int8),
        np.full((80, 120), 50, np.int8)[:5, :5],
    ):
        assert decide(count_values(cells)) is STORED


def test_one_rule_holds_for_all_maps_whatever_is_selected(tmp_path):
    # Nothing but free cells in the first map: by itself it could be of any kind.
    maps = [np.where(building() == 0, 0, -1).astype(np.int8), STORED_AS["zero and one"](building())]
    path = log_of(tmp_path / "run.mcap", *maps)
    with open_log(path) as reader:
        first, last = reader.first(), reader.last()
        assert reader.decided == {"values": {"values": "0 and 1", "free_below": 0.5, "occupied_above": 0.5}}
    assert (first.cells.max(), last.cells.max()) == (0, 100)


def test_patches_are_read_as_their_maps_are(tmp_path):
    right = building()
    log = McapLog(tmp_path / "run.mcap")
    log.add("/map", START_NS, Map(np.full(right.shape, -1, np.int8)))
    log.add("/map_updates", START_NS + 10**9, Update(0, 0, changed(right, wall=1)))
    found, warning_log = read(log.close())
    np.testing.assert_array_equal(found[-1], right)
    assert warning_log.kinds["values"].count == 1


def test_naming_a_threshold_names_the_reading_unless_one_is_named():
    assert Parameters.from_any({"occupancy.free_max_percent": 19.6}).occupancy.values == "percent"
    named = {"occupancy.free_max_percent": 19.6, "occupancy.values": "auto"}
    assert Parameters.from_any(named).occupancy.values == "auto"
    costs = Parameters.from_any({"occupancy.values": "costs"})
    assert costs.replaced({"occupancy.free_max_percent": 10.0}).occupancy.values == "costs"
    with pytest.raises(ParameterError, match=r"occupancy\.values"):
        Parameters.from_any({"occupancy.values": "guess"})


def snapshot_of(cells):
    geometry = GridGeometry(0.05, (0.0, 0.0), 0.0, "map", cells.shape)
    return OccupancySnapshot(0, 0, 0, "/map", cells, geometry)


def test_a_map_with_hardly_any_wall_is_told_of_and_others_are_not():
    usual = OccupancyParameters()
    assert few_walls(snapshot_of(building()), usual) is None
    assert few_walls(snapshot_of(building(40)), usual) is None
    assert few_walls(snapshot_of(inflated(building())), usual) is None
    without = np.where(building() == 100, -1, building())
    assert "only 0% of the border" in few_walls(snapshot_of(without), usual)
    assert few_walls(snapshot_of(without[10:20, 10:20]), usual) is None
    rays = np.pad(building(), 400, constant_values=-1)
    rays[:400:4] = rays[:, :400:4] = 0
    assert few_walls(snapshot_of(rays), usual) is None


def test_maps_that_are_none_of_a_building_are_told_of_by_kind():
    usual, noise = OccupancyParameters(), np.random.default_rng(5)
    assert oddity(snapshot_of(building()), usual) is None
    assert oddity(snapshot_of(np.full((9, 9), -1, np.int8)), usual) is None
    without = np.where(building() == 100, -1, building())
    full = np.full((90, 90), 100, np.int8)
    strewn = noise.choice(np.array([-1, 0, 100], np.int8), (200, 200))
    swapped = changed(building(), free=100, wall=0)
    told = [oddity(snapshot_of(cells), usual) for cells in (without, full, strewn, swapped)]
    assert [each[0] for each in told] == ["few_walls", "nothing_free", "no_building", "swapped"]
    # A building in solid black is none of these.
    solid = np.where(building() == -1, 100, building()).astype(np.int8)
    assert oddity(snapshot_of(np.pad(solid, 100, constant_values=100)), usual) is None
    assert all("\n" not in each[1] for each in told)


def save(folder, pixels, name="map", **described):
    Image.fromarray(pixels.astype(np.uint8)).save(folder / f"{name}.pgm")
    about = {
        "image": f"{name}.pgm", "resolution": 0.05, "origin": "[0, 0, 0]", "negate": 0,
        "occupied_thresh": 0.65, "free_thresh": 0.196,
    } | described  # fmt: skip
    path = folder / f"{name}.yaml"
    path.write_text("".join(f"{key}: {value}\n" for key, value in about.items()))
    return path


def grays(cells, *, unknown=205, free=254, wall=0):
    return np.flipud(np.select([cells == -1, cells == 0], [unknown, free], wall))


def faint(cells):
    """Walls as averages of hits and misses: all grays, most of them bright."""
    random = np.random.default_rng(2)
    pixels = grays(cells)
    walls = pixels == 0
    pixels[walls] = random.integers(95, 150, walls.sum())
    return pixels


def graded(cells):
    """Free cells of many grays around unknown ones of 128, as Cartographer's maps are saved."""
    random = np.random.default_rng(3)
    pixels = grays(cells, unknown=128, wall=40)
    pixels[pixels == 254] = random.integers(150, 250, (pixels == 254).sum())
    return pixels


SAVED_AS = {
    "free of 190": lambda cells: grays(cells, unknown=128, free=190, wall=60),
    "free of 180, unknown of 127": lambda cells: grays(cells, unknown=127, free=180, wall=30),
    "graded, walls of 105": lambda cells: np.where(graded(cells) == 40, 105, graded(cells)),
    "graded": graded,
    "faint": faint,
    "walls of 120": lambda cells: grays(cells, wall=120),
}


@pytest.mark.parametrize("name", SAVED_AS)
@pytest.mark.parametrize("free_thresh", [0.196, 0.25])
def test_saved_maps_whose_thresholds_do_not_fit_show_their_building_and_it_is_told(
    name, free_thresh, tmp_path
):
    path = save(tmp_path, SAVED_AS[name](building()), free_thresh=free_thresh)
    (cells,), warning_log = read(path)
    np.testing.assert_array_equal(cells, building())
    assert warning_log.kinds["values"].count == 1
    (cells,), warning_log = read(path, values="stored")
    assert "values" not in warning_log.kinds
    assert (cells != building()).any()


def test_thresholds_that_were_named_win_over_those_of_a_saved_map(tmp_path):
    path = save(tmp_path, SAVED_AS["walls of 120"](building()))
    (cells,), warning_log = read(path, occupied_min_percent=50.0)
    np.testing.assert_array_equal(cells, building())
    assert not warning_log.kinds
    assert (read(path, occupied_min_percent=60.0)[0][0] <= 0).all()


def test_one_rule_holds_for_all_maps_of_a_folder(tmp_path):
    for k, seen in enumerate((40, 80, 120)):
        save(tmp_path, graded(building(seen)), f"map{k}")
    found, warning_log = read(tmp_path)
    for cells, seen in zip(found, (40, 80, 120), strict=True):
        np.testing.assert_array_equal(cells, building(seen))
    assert warning_log.kinds["values"].count == 1


def test_an_edited_map_keeps_its_unknown_cells_though_its_free_thresh_is_too_high(tmp_path):
    pixels = grays(building())
    pixels[40, 10:40] = 240
    (cells,), warning_log = read(save(tmp_path, pixels, free_thresh=0.25))
    np.testing.assert_array_equal(cells, building())
    assert warning_log.kinds["free_thresh"].count == 1


FAULTS = {
    "carto_smooth.mcap": "values", "carto_mid.mcap": "values", "saved_pb2/map.yaml": "values",
    "zero_one.mcap": "values", "fifty.mcap": "values", "uint8cost.mcap": "values",
    "saved_ft25edit/map.yaml": "free_thresh", "gazebo_reset.mcap": "clock_set_back",
    "renamed": "file_missing",
    "saved_maps/map.yaml": "image_elsewhere", "saved_tilde/map.yaml": "image_elsewhere",
}  # fmt: skip


@pytest.mark.skipif(not (SHARED / "faults").is_dir(), reason="needs ../shared/faults")
@pytest.mark.parametrize("name", FAULTS)
def test_what_went_wrong_in_real_logs_is_read_and_told(name):
    with collect_warnings() as found, open_log(SHARED / "faults" / name) as reader:
        last = list(reader.snapshots())[-1]
    assert FAULTS[name] in found.kinds
    kinds = kinds_of(last.cells)
    free, walls = int((kinds == 0).sum()), int((kinds == 100).sum())
    # The log whose clock was set back ends with half of the building.
    assert free in ((44896, 44806) if name != "gazebo_reset.mcap" else (31130, 44896))
    assert 0.85 * 3464 <= walls <= 3464 or walls == 2410
