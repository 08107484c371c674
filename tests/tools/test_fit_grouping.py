"""The fit of border strengths: atoms, graph of regions, joins, trees, simulated buildings."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

TOOL = Path(__file__).parents[2] / "tools/fit_grouping/fit_everything.py"


@pytest.fixture(scope="module")
def two_rooms():
    """Two rooms of 5 m x 4 m with a door of 0.9 m, 5 cm a cell; free, occupied, true rooms."""
    occupied = np.ones((86, 206), bool)
    occupied[3:83, 3:101] = False
    occupied[3:83, 105:203] = False
    occupied[30:48, 101:105] = False
    truth = np.zeros(occupied.shape, np.int32)
    truth[:, :103], truth[:, 103:] = 1, 2
    truth[occupied] = 0
    return ~occupied, occupied, truth


@pytest.fixture(scope="module")
def prepared(two_rooms):
    from fit_grouping.maps_with_truth import TruthMap
    from fit_grouping.preparing import prepare

    from rose2_logs.config.parameters import Parameters

    free, occupied, truth = two_rooms
    one = TruthMap("drawn", "two rooms", "two rooms", 0.05, free, occupied, (truth,))
    return prepare(one, Parameters(), 0)


def test_atoms_of_two_rooms_do_not_cross_the_wall(prepared):
    from fit_grouping.scores import upper_bound

    assert len(prepared.tables[0]) > 2
    assert upper_bound(prepared.tables) > 98


def test_a_lower_level_joins_more(prepared):
    from fit_grouping.sampling import by_hand

    from rose2_logs.segmentation.regions.joining import join_regions

    graph = prepared.graph(None)
    joins = join_regions(graph, by_hand, -10)
    counts = [joins.regions(level).max() + 1 for level in (-9, -1, 0, 1, 9)]
    assert counts == sorted(counts)
    assert counts[0] == 1


def test_samples_join_only_what_is_one_room(prepared):
    from fit_grouping.sampling import by_hand, sample_joins

    graph = prepared.graph(None)
    samples = sample_joins(graph, tuple(t[1:] for t in prepared.tables), by_hand, 0.0, 0)
    atoms = len(graph.node_sums)
    rooms = len(set(prepared.tables[0][1:].argmax(1)))
    assert samples.right.sum() == atoms - rooms
    assert (~samples.right).sum() >= 1
    assert (samples.weight > 0).all()


def test_trees_as_arrays_answer_as_the_fitted_model():
    from fit_grouping.tree_files import trees_of
    from sklearn.ensemble import HistGradientBoostingClassifier

    from rose2_logs.segmentation.regions.features import FEATURES

    rng = np.random.default_rng(0)
    features = rng.normal(size=(900, len(FEATURES)))
    right = features[:, 3] + features[:, 5] ** 2 > 1
    columns = np.array([3, 5, 7])
    model = HistGradientBoostingClassifier(max_iter=9, max_leaf_nodes=6, random_state=0)
    model.fit(features[:, columns], right)
    trees = trees_of(model, columns)
    expected = model.decision_function(features[:, columns])
    np.testing.assert_allclose(trees(features), expected, atol=1e-6)


def test_trees_of_one_kind_of_decision_are_refused():
    from fit_grouping.tree_files import trees_of
    from sklearn.ensemble import HistGradientBoostingClassifier

    features = np.random.default_rng(0).normal(size=(50, 3))
    model = HistGradientBoostingClassifier(max_iter=2).fit(features, np.ones(50, bool))
    with pytest.raises(ValueError, match="one kind"):
        trees_of(model, np.arange(3))


def test_rule_fitted_without_anything_outside_keeps_every_room(prepared):
    from fit_grouping.fit_tree import examples_of
    from fit_grouping.outside import SURE_LOG_ODDS, fit_outside

    from rose2_logs.segmentation.regions.features import region_features

    (example,) = examples_of([prepared], [None])
    rooms = prepared.tables[0][1:].argmax(1) > 1
    rule = fit_outside([example], [rooms.astype(np.int64)], 0)
    np.testing.assert_array_equal(rule(region_features(example.graph)), SURE_LOG_ODDS)


def test_maps_without_free_floor_have_no_rooms():
    from fit_grouping.fit_tree import examples_of, gather
    from fit_grouping.maps_with_truth import TruthMap
    from fit_grouping.preparing import prepare
    from fit_grouping.sampling import by_hand
    from fit_grouping.scores import upper_bound

    from rose2_logs.config.parameters import Parameters

    occupied = np.zeros((40, 60), bool)
    occupied[20] = True
    nothing = np.zeros(occupied.shape, bool)
    one = TruthMap("drawn", "wall", "wall", 0.05, nothing, occupied, (nothing.astype(np.int32),))
    map_without_floor = prepare(one, Parameters(), 0)
    assert upper_bound(map_without_floor.tables) == 0
    samples = gather(examples_of([map_without_floor], [None]), by_hand, 0.0, 0)
    assert (len(samples.right), len(samples.weight)) == (0, 0)


@pytest.mark.parametrize("seed", range(6))
def test_simulated_maps_are_the_same_for_the_same_seed(seed):
    from fit_grouping.buildings.make_buildings import simulate

    one, again = simulate(seed), simulate(seed)
    assert np.array_equal(one.gray, again.gray)
    for truth in one.truths:
        assert truth.shape == one.gray.shape
        assert (one.gray[truth > 0] == 254).all()
        assert set(np.unique(truth[truth > 0])) == set(range(1, truth.max() + 1))


@pytest.mark.parametrize("seed", range(4))
def test_villas_are_grown_in_one_piece(seed):
    """Every room of a villa is connected and touches the rest of the house."""
    from fit_grouping.buildings.villas import villa
    from scipy.ndimage import label

    plan = villa(np.random.default_rng(seed))
    plan.tidy()
    numbers = np.unique(plan.rooms[plan.rooms > 0]).tolist()
    assert len(numbers) >= 3
    assert plan.public <= set(numbers)
    assert plan.public
    for number in numbers:
        assert label(plan.rooms == number)[1] == 1
    assert label(plan.rooms > 0, np.ones((3, 3)))[1] == 1


WITH_CORRIDORS = ("offices", "faculty", "suites", "loop", "wings", "cellular")
LARGE = (*WITH_CORRIDORS, "depot", "arena", "shop", "gallery", "warehouse", "partitions")
OPEN_HOMES = ("openhome", "hallways")


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", [*LARGE, *OPEN_HOMES])
def test_rooms_of_buildings_are_in_one_piece(kind, seed):
    """Rooms are connected, large enough to stand in, and marked as what the maker made them."""
    from fit_grouping.buildings.makers import MAKERS
    from fit_grouping.buildings.plans import ROOM_MIN_M2
    from fit_grouping.buildings.raster import CELL_M
    from scipy.ndimage import label

    (maker,) = [maker for maker, _ in MAKERS if maker.__name__ == kind]
    plan = maker(np.random.default_rng(seed))
    plan.tidy()
    numbers = np.unique(plan.rooms[plan.rooms > 0]).tolist()
    assert plan.kind == kind
    for kinds in plan.marks:
        assert kinds <= set(numbers)
    if kind not in ("gallery", *OPEN_HOMES):
        assert bool(plan.corridors) == (kind in WITH_CORRIDORS)
    for number in numbers:
        assert label(plan.rooms == number)[1] == 1
        assert np.count_nonzero(plan.rooms == number) * CELL_M**2 >= ROOM_MIN_M2
    for ground in (plan.yard, plan.strip):
        assert ground is None or not (plan.rooms[ground > 0] > 0).any()


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("kind", [*LARGE, *OPEN_HOMES])
def test_true_rooms_of_buildings_are_free_floor(kind, seed, monkeypatch):
    """Rooms are seen within the building only: what is free around it has no room."""
    from fit_grouping.buildings import make_buildings, sensing

    kept = {}

    def sensed(rng, rooms, other, gray):
        kept["rooms"], kept["gray"] = rooms, gray
        return rooms, other, gray

    monkeypatch.setattr(sensing, "_warped", sensed)
    made = make_buildings.simulate(seed, [kind])
    assert made.kind.startswith(kind + "/")
    window = sensing._known_window(kept["gray"], kept["rooms"])
    for truth in made.truths:
        assert (made.gray[truth > 0] == sensing.FREE).all()
        assert not truth[kept["rooms"][window] == 0].any()


def test_ground_that_is_driven_on_is_free_and_no_room():
    """The robot that drives around an arena sees floor there, which belongs to no room."""
    from fit_grouping.buildings.plans import Plan
    from fit_grouping.buildings.raster import CELL_M
    from fit_grouping.buildings.sensing import FREE, make_map
    from fit_grouping.buildings.walls import build_walls

    plan = Plan.empty("arena", 120, 100)
    plan.hall(plan.inner)
    plan.yard = (plan.rooms == 0).astype(np.uint8)
    plan.strip = np.zeros_like(plan.yard)
    plan.strip[10:20, 60:180] = 1
    walled = build_walls(np.random.default_rng(5), plan)
    made = make_map(np.random.default_rng(5), walled, np.zeros_like(walled.walls), "office")
    outside = (made.gray == FREE) & (made.truths[0] == 0)
    assert np.count_nonzero(outside) * CELL_M**2 > 10
    assert made.truths[0].max() == 1


@pytest.mark.parametrize(
    "kind",
    ["cabinets", "double", "gap", "large gap", "pieces", "piers", "counter", "stub", "one side", "end gap"],
)
def test_wide_openings_part_and_let_through(kind, monkeypatch):
    from fit_grouping.buildings import walls
    from fit_grouping.buildings.plans import Plan
    from scipy.ndimage import label

    rooms = np.zeros((140, 320), np.int32)
    rooms[20:60, 20:300], rooms[60:120, 20:300] = 1, 2
    monkeypatch.setattr(walls, "_opening_kind", lambda *_: kind)
    plan = Plan("offices", rooms, corridors={1, 2} if kind == "double" else {1}, labs={2})
    walled = walls.build_walls(np.random.default_rng(1), plan)
    assert walled.neighbors[1] == [2]
    assert (walled.other == rooms).all()
    pieces = label((walled.walls == 0) & (rooms > 0))[0]
    largest = np.argmax(np.bincount(pieces.ravel())[1:]) + 1
    assert set(np.unique(rooms[pieces == largest])) == {1, 2}
    border = walled.walls[60, 25:295] > 0
    assert 0.01 < border.mean() < 0.97


@pytest.mark.parametrize("seed", range(4))
def test_gaps_between_offices_leave_a_stub_at_both_ends(seed, monkeypatch):
    from fit_grouping.buildings import walls
    from fit_grouping.buildings.plans import Plan
    from fit_grouping.buildings.raster import cells

    rooms = np.zeros((160, 260), np.int32)
    rooms[20:140, 20:130], rooms[20:140, 130:240] = 1, 2
    monkeypatch.setattr(walls, "SUITE_OPENINGS", {"gap": 1.0})
    plan = Plan("suites", rooms, suite={1, 2})
    walled = walls.build_walls(np.random.default_rng(seed), plan)
    open_rows = np.flatnonzero(walled.walls[20:140, 129] == 0)
    assert open_rows[0] >= cells(walls.STUB_MIN_M)
    assert open_rows[-1] < 120 - cells(walls.STUB_MIN_M)
    assert 0.15 < len(open_rows) / 120 < 0.67


def test_offices_of_a_suite_meet_beside_their_ways_to_the_corridor():
    """Rooms that a corridor joins already have gaps to each other as often as the plan says."""
    from fit_grouping.buildings.plans import Plan
    from fit_grouping.buildings.walls import build_walls

    rooms = np.zeros((140, 420), np.int32)
    rooms[20:50, 20:400] = 1
    for number in range(4):
        rooms[50:120, 20 + 95 * number : 115 + 95 * number] = 2 + number
    for joined in (0.0, 1.0):
        plan = Plan("suites", rooms, corridors={1}, suite={2, 3, 4, 5}, joined=joined)
        walled = build_walls(np.random.default_rng(2), plan)
        meet = [(walled.walls[60:110, 114 + 95 * number] == 0).any() for number in range(3)]
        assert meet == [joined == 1.0] * 3
        assert (walled.other == rooms).all()


@pytest.mark.parametrize("seed", range(4))
def test_a_hallway_without_a_jamb_is_a_room_of_its_own(seed, monkeypatch):
    """A narrow hallway that opens into a wide room without a jamb is parted from it in both truths."""
    from fit_grouping.buildings import walls
    from fit_grouping.buildings.plans import Plan

    rooms = np.zeros((160, 320), np.int32)
    rooms[60:90, 20:150], rooms[20:140, 150:300] = 1, 2
    monkeypatch.setattr(walls, "FLOWING_OPENINGS", {"open": 1.0})
    plan = Plan("hallways", rooms, flowing={1, 2})
    walled = walls.build_walls(np.random.default_rng(seed), plan)
    assert (walled.walls[69:81, 149] == 0).all()
    assert (walled.other == rooms).all()


@pytest.mark.parametrize("seed", range(4))
def test_walls_that_stand_in_a_hall_leave_it_whole(seed):
    """One can walk around every piece of wall: the floor of each hall hangs together."""
    from fit_grouping.buildings.faint_borders import PASSAGE_M, partitions
    from fit_grouping.buildings.raster import cells
    from scipy.ndimage import binary_erosion, label

    plan = partitions(np.random.default_rng(seed))
    assert plan.things.any()
    assert not plan.things[~np.isin(plan.rooms, list(plan.halls))].any()
    for hall in plan.halls & set(np.unique(plan.rooms).tolist()):
        floor = plan.rooms == hall
        wide = binary_erosion(floor, iterations=cells(PASSAGE_M) // 3)
        free = binary_erosion(floor & (plan.things == 0), iterations=cells(PASSAGE_M) // 3)
        assert label(free)[1] <= label(wide)[1]


def test_walls_between_cellular_offices_are_mostly_frayed():
    """Gaps in the walls between offices, beside their doors to the corridor."""
    from fit_grouping.buildings.faint_borders import cellular
    from fit_grouping.buildings.walls import border_runs, build_walls

    open_shares = []
    for seed in range(6):
        plan = cellular(np.random.default_rng(seed))
        plan.tidy()
        walled = build_walls(np.random.default_rng(seed), plan)
        offices = set(np.unique(plan.rooms).tolist()) - {0} - plan.corridors
        for pair, runs in border_runs(plan.rooms).items():
            if set(pair) <= offices:
                run = max(runs, key=lambda run: run.length)
                line = (walled.walls if run.upright else walled.walls.T)[run.low : run.high, run.at]
                open_shares.append(np.mean(line == 0))
    assert np.mean(np.array(open_shares) > 0.1) > 0.25


@pytest.mark.parametrize("seed", range(3))
def test_a_ring_corridor_is_one_room(seed):
    from fit_grouping.buildings.joined_rooms import loop

    plan = loop(np.random.default_rng(seed))
    plan.tidy()
    sizes = np.bincount(plan.rooms.ravel())[sorted(plan.corridors)]
    assert sizes.max() > 0.8 * sizes.sum()


def test_floor_within_crates_belongs_to_the_hall(monkeypatch):
    """Outlines that can be looked into enclose floor, which is no room of its own."""
    from fit_grouping.buildings import furniture, sensing
    from fit_grouping.buildings.plans import Plan
    from fit_grouping.buildings.walls import build_walls
    from scipy.ndimage import label

    monkeypatch.setitem(furniture.OTHER_HALLS, "warehouse", {"crates": 1.0})
    monkeypatch.setitem(sensing.DRAWN_SHARE, "warehouse", 1.0)
    plan = Plan.empty("warehouse", 500, 400)
    plan.hall(plan.inner)
    rng = np.random.default_rng(4)
    walled = build_walls(rng, plan)
    made = sensing.make_map(rng, walled, furniture.Furnisher(rng, walled, "office").furnish(), "office")
    pieces, count = label(made.truths[0] == 1)
    assert made.truths[0].max() == 1
    assert count > 3
    assert np.count_nonzero(pieces > 0) > 0.9 * (plan.rooms > 0).sum()


@pytest.fixture
def slanting_rooms():
    """Two rooms on one side each of a line at 35 degrees through a square of 8 m."""
    y, x = np.mgrid[:200, :200]
    angle = np.deg2rad(35)
    beyond = np.sin(angle) * (x - 100) - np.cos(angle) * (y - 100) > 0
    rooms = np.where(beyond, 2, 1).astype(np.int32)
    rooms[:20] = rooms[-20:] = 0
    rooms[:, :20] = rooms[:, -20:] = 0
    return rooms, angle


def test_slanting_borders_are_followed(slanting_rooms):
    from fit_grouping.buildings.walls import border_runs, straight_stretch

    rooms, angle = slanting_rooms
    stretch = straight_stretch(np.random.default_rng(0), border_runs(rooms)[1, 2])
    across = np.cos(angle) * stretch.direction[1] - np.sin(angle) * stretch.direction[0]
    assert abs(across) < 0.06
    assert 160 < stretch.length < 200


@pytest.mark.parametrize("seed", range(5))
def test_rooms_beside_a_slanting_wall_are_joined_by_an_opening(seed, slanting_rooms):
    from fit_grouping.buildings.plans import Plan
    from fit_grouping.buildings.walls import build_walls
    from scipy.ndimage import label

    rooms, _ = slanting_rooms
    walled = build_walls(np.random.default_rng(seed), Plan("villa", rooms, public={1, 2}))
    pieces = label((walled.walls == 0) & (rooms > 0))[0]
    largest = np.argmax(np.bincount(pieces.ravel())[1:]) + 1
    assert set(np.unique(rooms[pieces == largest])) == {1, 2}
    assert walled.neighbors[1] == [2] * len(walled.neighbors[1])


@pytest.mark.parametrize(("low", "high", "parted"), [(20, 120, False), (50, 90, True)])
def test_a_change_of_width_parts_rooms_without_jambs(low, high, parted):
    from fit_grouping.buildings.walls import border_runs, only_taste_parts, straight_stretch

    rooms = np.zeros((140, 200), np.int32)
    rooms[20:120, 20:100] = 1
    rooms[low:high, 100:180] = 2
    stretch = straight_stretch(np.random.default_rng(0), border_runs(rooms)[1, 2])
    assert only_taste_parts(rooms, stretch) != parted


@pytest.mark.parametrize("angle", [0.3, 0.785, 1.2])
def test_slanting_rooms_are_furnished_in_their_own_frame(angle):
    from fit_grouping.buildings.furniture import room_frame

    y, x = np.mgrid[:220, :220] - 110
    along, across = np.cos(angle) * x + np.sin(angle) * y, np.cos(angle) * y - np.sin(angle) * x
    inside = (np.abs(along) < 90) & (np.abs(across) < 45)
    frame = room_frame(inside)
    assert sorted(frame.shape) == pytest.approx([90, 180], abs=4)
    back = frame.back(np.ones(frame.shape, np.uint8), inside.shape) > 0
    assert np.count_nonzero(back & inside) > 0.97 * np.count_nonzero(inside | back)
    assert room_frame(np.ones((40, 60), bool)) is None


def test_simulated_maps_come_back_from_their_file(tmp_path):
    from fit_grouping.buildings.make_buildings import read_maps, simulate, write_maps

    maps = [simulate(3), simulate(4)]
    write_maps(tmp_path / "maps.npz", maps)
    for one, read in zip(maps, read_maps(tmp_path / "maps.npz"), strict=True):
        assert one.kind == read.kind
        assert np.array_equal(one.gray, read.gray)
        assert all(np.array_equal(a, b) for a, b in zip(one.truths, read.truths, strict=True))


def test_maps_of_the_wanted_kinds_are_made(tmp_path):
    from fit_grouping.buildings.make_buildings import read_maps

    script = TOOL.parent / "buildings/make_buildings.py"
    run(script, tmp_path / "maps.npz", "--count", 3, "--kinds", "suites,openhome")
    kinds = {made.kind.split("/")[0] for made in read_maps(tmp_path / "maps.npz")}
    assert kinds <= {"suites", "openhome"}
    command = [sys.executable, str(script), str(tmp_path / "none.npz"), "--kinds", "castle"]
    refused = subprocess.run(command, check=False, capture_output=True, text=True)
    assert refused.returncode == 2
    assert "no such kind of plan: castle; there are villa, home" in refused.stderr


def test_targets_ask_about_pairs_of_rooms_only_where_truths_agree():
    from fit_grouping.truth_rasters import network_targets

    from rose2_logs.segmentation.regions.plan_raster import OFFSETS

    first = np.zeros((40, 40), np.int32)
    first[5:35, 5:20], first[5:35, 20:35] = 1, 2
    united = np.where(first > 0, 1, 0).astype(np.int32)
    valid = np.ones(first.shape, bool)
    targets, weights = network_targets(valid, [first])
    level = OFFSETS.index((0, 2))
    assert targets[level, 10, 21] == 1
    assert targets[level, 10, 15] == 0
    assert weights[level, 10, 21] > weights[level, 10, 15] > 0
    assert targets[-1, 0, 0] == 1
    _, weights = network_targets(valid, [first, united])
    assert weights[level, 10, 21] == 0
    assert weights[level, 10, 15] > 0


def test_score_of_a_grouping_is_that_of_its_label_image():
    from fit_grouping.scores import grouped, iou_sym, overlap_table

    rng = np.random.default_rng(0)
    atoms, truth = rng.integers(0, 9, (2, 20, 30)).astype(np.int32) // [[[1]], [[3]]]
    region_of_atom = np.array([1, 1, 2, 0, 3, 3, 2, 1])
    drawn = np.append(0, region_of_atom)[atoms]
    of_image = overlap_table(drawn, truth)
    assert np.array_equal(grouped(overlap_table(atoms, truth), region_of_atom), of_image)
    assert 0 < iou_sym(of_image) < 100
    assert iou_sym(np.array([[0.0, 0, 0], [0, 8, 0], [0, 0, 8]])) == 100


def test_network_answers_the_same_from_its_file(tmp_path, prepared):
    torch = pytest.importorskip("torch")
    from fit_grouping.network import RoomNetwork, export_onnx

    from rose2_logs.segmentation.regions.answers import AnsweringNetwork
    from rose2_logs.segmentation.regions.plan_raster import OUTPUTS, PlanRaster, network_input, shares_of

    torch.manual_seed(0)
    network = RoomNetwork((4, 6, 8, 8, 8)).eval()
    export_onnx(network, tmp_path / "n.onnx")
    raster = prepared.atoms.raster
    height, width = (side // 32 * 32 for side in raster.wall.shape)
    whole = PlanRaster(raster.wall[:height, :width], raster.free[:height, :width])
    answers = AnsweringNetwork(tmp_path / "n.onnx")(whole, views=1)
    inputs = torch.from_numpy(network_input(shares_of(whole.wall), shares_of(whole.free))[None])
    expected = torch.sigmoid(network(inputs))[0].detach().numpy()
    assert answers.shape == (OUTPUTS, height, width)
    np.testing.assert_allclose(answers, expected, atol=2e-3)


@pytest.fixture
def three_homes(tmp_path):
    """Cases of three simulated maps that are left out in three folds."""
    from fit_grouping.buildings.make_buildings import simulate

    cases = []
    for number, seed in enumerate((2, 3, 8)):
        one = simulate(seed, ["home"])
        name = f"home_{2 * number}"
        Image.fromarray(np.flipud(one.gray)).save(tmp_path / f"{name}.png")
        Image.fromarray(np.flipud(one.truths[0]).astype(np.uint8)).save(tmp_path / f"{name}.rooms.png")
        images = {"map": f"{name}.png", "rooms": f"{name}.rooms.png"}
        cases.append({"group": "homes", "name": name, "resolution_m": 0.05, **images})
    (tmp_path / "cases.json").write_text(json.dumps({"cases": cases}), encoding="utf-8")
    return tmp_path / "cases.json"


def run(script, *arguments):
    one_thread = os.environ | {"OMP_NUM_THREADS": "1"}
    command = [sys.executable, TOOL.parent / script, *map(str, arguments)]
    return subprocess.run(command, check=True, env=one_thread, stdout=subprocess.PIPE, text=True).stdout


def check_fitted(work, cases):
    """The folder for the package is whole, and the analysis runs with what was fitted without each fold."""
    from rose2_logs.segmentation.regions.features import REGION_FEATURES
    from rose2_logs.segmentation.regions.fitted import FILES, JOINS, MANIFEST, OUTSIDE, OWN_ROOMS, sha256_of
    from rose2_logs.segmentation.regions.own_rooms import OWN_ROOM_FEATURES
    from rose2_logs.segmentation.regions.strengths import read_trees

    ships = work / "seed0/all"
    manifest = json.loads((ships / MANIFEST).read_text(encoding="utf-8"))
    assert manifest["sha256"] == {name: sha256_of(ships / name) for name in FILES}
    assert manifest["real maps"] == 3
    assert len(read_trees(ships / JOINS).feature) == 8
    read_trees(ships / OUTSIDE, REGION_FEATURES)
    read_trees(ships / OWN_ROOMS, OWN_ROOM_FEATURES)
    assert "| mean of the seeds |" in run("left_out_figures.py", work, "--cases", cases, "--seeds", 1)
    assert len(list((work / "seed0/predictions/homes").glob("*.png"))) == 3


SMALL = ("--tree-buildings", 2, "--trees", 8, "--seeds", 1)


def test_trees_are_fitted_without_training_a_network(tmp_path, three_homes):
    """The fit of a minute."""
    from rose2_logs.segmentation.regions import fitted

    work = tmp_path / "work"
    arguments = (work, "--cases", three_homes, "--buildings", 0, "--network", fitted.FOLDER / fitted.NETWORK)
    run("fit_everything.py", *arguments, *SMALL)
    check_fitted(work, three_homes)


def test_everything_is_fitted_by_one_command(tmp_path, three_homes):
    """A tiny run: three maps in three folds, trained on for a second."""
    pytest.importorskip("torch", reason="the network is trained with torch, which is not installed")
    work = tmp_path / "work"
    arguments = (work, "--cases", three_homes, "--buildings", 4, "--network-seconds", 1, "--fold-seconds", 1)
    run("fit_everything.py", *arguments, *SMALL)
    check_fitted(work, three_homes)
    made = {path: path.stat().st_mtime_ns for path in (work / "networks").iterdir()}
    run("fit_everything.py", *arguments, *SMALL)
    assert {path: path.stat().st_mtime_ns for path in (work / "networks").iterdir()} == made


def test_two_processes_train_one_network(tmp_path):
    """Both change the same weights, and nothing of the second one is left when the time is over."""
    torch = pytest.importorskip("torch", reason="the network is trained with torch, which is not installed")
    run("buildings/make_buildings.py", tmp_path / "maps/0.npz", "--count", 3, "--kinds", "home")
    out = tmp_path / "network"
    run("train_network.py", out, "--simulated", tmp_path / "maps", "--seconds", 3, "--processes", 2)
    state = torch.load(out.with_suffix(".pt"))
    assert state["steps"] > 0
    assert state["seconds"] >= 3
    # The counter of batches is shared, the optimizer is not: it has seen those of the first process alone.
    batches = int(state["network"]["stem.1.num_batches_tracked"])
    assert batches > state["steps"]
    left_over = subprocess.run(["pgrep", "-f", str(out)], check=False, capture_output=True, text=True)
    assert left_over.stdout == ""
