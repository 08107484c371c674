"""Floor plans read back by the programs' own readers."""

from __future__ import annotations

import dataclasses
import json
import os
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import ezdxf
import networkx as nx
import numpy as np
import pytest
import shapely
import yaml
from drawn_plans import LEFT, RIGHT, two_rooms_plan
from PIL import Image
from shapely.geometry import shape

from rose2_logs.config.parameters import OccupancyParameters
from rose2_logs.errors import MissingPackageError, OutputError, ParameterError
from rose2_logs.io import open_log
from rose2_logs.io.room_names import read_room_names
from rose2_logs.model.occupancy import GridGeometry
from rose2_logs.model.room_plan import PlanMap, wall_outlines
from rose2_logs.outputs.exports.dxf import LAYERS
from rose2_logs.outputs.exports.formats import FORMATS, planned_files, write_plan
from rose2_logs.outputs.exports.layers import LAYERS as QGIS_LAYERS
from rose2_logs.runs.run import Run


@pytest.fixture(params=[0.0, 0.4], ids=["straight", "turned"])
def plan(request):
    return two_rooms_plan(request.param)


@pytest.fixture
def real_plan(office_results: Path):
    return Run(office_results)[-1].plan()


def test_geojson_is_read_by_shapely(plan, tmp_path: Path):
    """Rooms, unseen parts, doorways and walls with what is known of them; rings turn as the standard asks."""
    (file,) = write_plan(plan, ["geojson"], tmp_path, "two")
    collection = json.loads(file.read_text())
    assert collection["type"] == "FeatureCollection"
    assert collection["map_frame"]["unit"] == "meter"
    assert "not longitude" in collection["map_frame"]["note"]
    # The standard forbids these names to collections.
    assert not {"coordinates", "geometry", "properties"} & collection.keys()
    found = {}
    for feature in collection["features"]:
        found.setdefault(feature["properties"]["kind"], []).append(feature)
    assert {kind: len(features) for kind, features in found.items()} == {
        "room": 2,
        "predicted": 1,
        "doorway": 1,
        "wall": 1,
    }
    assert 'LENGTHUNIT["metre",1]' in collection["crs"]["properties"]["name"]
    for feature, room in zip(found["room"], plan.rooms, strict=True):
        polygon = shape(feature["geometry"])
        assert polygon.symmetric_difference(room.shape).area < 1e-2
        assert polygon.exterior.is_ccw
        about = feature["properties"]
        assert (about["room"], about["name"]) == (room.number, room.name)
        assert (about["area_m2"], about["wall_support"]) == pytest.approx((room.area_m2, 0.75))
        assert about["neighbors"] == list(room.neighbors)
    (door,) = found["doorway"]
    assert shape(door["geometry"]).length == pytest.approx(door["properties"]["width_m"], abs=1e-3) == 1.0
    assert door["properties"]["rooms"] == [LEFT, RIGHT]
    assert shape(found["predicted"][0]["geometry"]).within(plan.rooms[1].shape.buffer(0.11))


def test_a_room_without_a_shape_has_no_geometry(tmp_path: Path):
    plan = two_rooms_plan()
    bare = dataclasses.replace(plan.rooms[0], shape=shapely.Polygon(), label_point_m=None)
    files = write_plan(dataclasses.replace(plan, rooms=(bare, plan.rooms[1])), list(FORMATS), tmp_path, "x")
    assert json.loads(files[0].read_text())["features"][0]["geometry"] is None


def test_dxf_passes_the_audit(plan, tmp_path: Path):
    """Layers, meters, outlines, hatches, doorways, labels."""
    (file,) = write_plan(plan, ["dxf"], tmp_path, "two")
    document = ezdxf.readfile(file)
    audit = document.audit()
    assert not audit.errors
    assert not audit.fixes
    assert document.units == ezdxf.units.M
    assert set(LAYERS) <= {layer.dxf.name for layer in document.layers}
    space = document.modelspace()
    outlines = space.query('LWPOLYLINE[layer=="ROOMS"]')
    assert [shapely.Polygon(list(each.vertices())).area for each in outlines] == pytest.approx([12.0, 12.0])
    assert len({each.dxf.true_color for each in outlines}) == 2
    assert all(each.closed for each in outlines)
    assert len(space.query('HATCH[layer=="PREDICTED"]')) == 1
    (door,) = space.query('LINE[layer=="DOORWAYS"]')
    assert np.allclose([door.dxf.start.vec2, door.dxf.end.vec2], plan.doorways[0].ends_m)
    # Two segments that meet are one wall, whose outline is as long as both and half a cell wide on each side.
    (wall,) = space.query('LWPOLYLINE[layer=="WALLS"]')
    assert shapely.Polygon(list(wall.vertices())).area == pytest.approx((8.0 + 3.0) * 0.05, rel=0.05)
    assert {each.dxf.text for each in space.query('TEXT[layer=="LABELS"]')} >= {"Room 3", "Room 120"}


def test_dxf_opens_on_the_plan(plan, tmp_path: Path):
    """Its extents and its view hold all that is drawn, and little more."""
    (file,) = write_plan(plan, ["dxf"], tmp_path, "two")
    document = ezdxf.readfile(file)
    low, high = (np.array(document.header[name][:2]) for name in ("$EXTMIN", "$EXTMAX"))
    x0, y0, x1, y1 = plan.bounds_m
    assert [*low, *high] == pytest.approx([x0, y0, x1, y1], abs=0.1)
    (view,) = document.viewports.get("*Active")
    seen = np.array([view.dxf.height * view.dxf.aspect_ratio, view.dxf.height])
    size = high - low
    # The center is relative to the target.
    middle = np.array((view.dxf.target + view.dxf.center).vec2)
    assert list(middle) == pytest.approx((low + high) / 2, abs=0.01)
    assert (size <= seen).all()
    assert (seen <= 1.1 * size).any()
    # LibreCAD 2.2 knows no target, and has its upper right corner at twice the center.
    corner = 2 * np.array(view.dxf.center.vec2)
    assert (corner - seen <= low).all()
    assert (corner >= high).all()


def labels_of(plan, folder: Path):
    """Texts of the labels in a DXF: what they say, height, angle in degrees, and the box that each is in."""
    (file,) = write_plan(plan, ["dxf"], folder, "labels")
    texts = ezdxf.readfile(file).modelspace().query('TEXT[layer=="LABELS"]')
    boxes = [ezdxf.bbox.extents([each]) for each in texts]
    return [
        (each.dxf.text, each.dxf.height, each.dxf.rotation, shapely.box(*box.extmin.vec2, *box.extmax.vec2))
        for each, box in zip(texts, boxes, strict=True)
    ]


def with_rooms(boxes_m):
    """A plan of rooms in boxes (x0, y0, x1, y1), labeled in the middle."""
    plan = two_rooms_plan()
    rooms = [
        dataclasses.replace(
            plan.rooms[0],
            number=number,
            shape=shapely.box(*box),
            label_point_m=tuple(np.add(box[:2], box[2:]) / 2),
        )
        for number, box in enumerate(boxes_m, start=1)
    ]
    return dataclasses.replace(plan, rooms=tuple(rooms), doorways=(), walls_m=np.zeros((0, 2, 2)), map=None)


@pytest.mark.parametrize("side_m", [12.0, 80.0, 400.0])
def test_labels_are_read_when_a_dxf_opens_and_are_within_their_rooms(side_m: float, tmp_path: Path):
    """Those of a small room are smaller; along a narrow one they are read from the right."""
    boxes = [
        (0.0, 0.0, side_m, side_m / 2),
        *(
            tuple(side_m * np.array([x0, y0, x1, y1]))
            for x0, y0, x1, y1 in ((0.0, 0.55, 0.1, 0.65), (0.2, 0.55, 0.24, 0.9), (0.3, 0.55, 0.9, 0.59))
        ),
    ]
    plan = with_rooms(boxes)
    labels = labels_of(plan, tmp_path)
    names, heights, angles, _ = zip(*labels[::2], strict=True)
    assert names == ("Room 1", "Room 2", "Room 3", "Room 4")
    assert heights[0] == max(heights) >= max(0.25, side_m * 0.75 / 80)
    assert angles == (0.0, 0.0, 90.0, 0.0)
    for room, (_, height, _, box), (_, _, _, area_box) in zip(
        plan.rooms, labels[::2], labels[1::2], strict=True
    ):
        assert height > 0.1
        # A box has space for what letters as g reach below the line.
        space = room.shape.buffer(0.3 * height)
        assert space.covers(box)
        assert space.covers(area_box)


def test_a_label_in_a_closet_is_as_small_as_can_be_read(tmp_path: Path):
    labels = labels_of(with_rooms([(0, 0, 30, 20), (0, 21, 0.3, 21.3)]), tmp_path)
    assert labels[2][1] == pytest.approx(0.1)


def test_overlapping_segments_are_one_wall():
    """Rows of cells a cell apart, both faces of a wall, and walls that meet; not what is apart."""
    rows = [[[0.0, y], [5.0, y]] for y in (0.0, 0.05, 0.1, 0.2)]
    corner, apart = [[[5.0, 0.0], [5.0, 3.0]]], [[[0.0, 1.0], [2.0, 1.0]]]
    plan = dataclasses.replace(two_rooms_plan(), walls_m=np.array(rows + corner + apart))
    wide, thin = sorted(wall_outlines(plan), key=lambda wall: -wall.area)
    assert wide.area == pytest.approx(5.05 * 0.25 + 2.8 * 0.05, rel=0.05)
    assert thin.bounds == pytest.approx((-0.025, 0.975, 2.025, 1.025))
    assert wall_outlines(dataclasses.replace(plan, walls_m=None)) == []


def test_layers_hold_one_kind_of_thing_each(plan, tmp_path: Path):
    """What the whole collection holds, each in a file with its style, whose colors are those of the rooms."""
    (whole,) = write_plan(plan, ["geojson"], tmp_path, "two")
    files = write_plan(plan, ["qgis"], tmp_path, "two")
    assert {file.name for file in files} == {file.name for file in tmp_path.iterdir()} - {whole.name}
    found = []
    for name, layer in QGIS_LAYERS.items():
        collection = json.loads((tmp_path / f"two.{name}.geojson").read_text())
        assert {each["properties"]["kind"] for each in collection["features"]} == {layer.kind}
        found += collection["features"]
        style = ET.parse(tmp_path / f"two.{name}.qml")
        colored = [each for each in style.iter("Option") if each.get("value") == "color"]
        assert len(colored) == (layer.kind in ("room", "predicted"))
        # What lies below the rooms is seen through them.
        assert style.findtext("blendMode") == ("6" if layer.kind == "room" else "0")
        assert all("color" in each["properties"] for each in collection["features"]) == bool(colored)
    everything = json.loads(whole.read_text())["features"]
    assert sorted(found, key=lambda each: each["id"]) == sorted(everything, key=lambda each: each["id"])


def test_the_same_plan_gives_the_same_files(plan, tmp_path: Path):
    """Byte for byte, also where a format would hold times and random numbers."""
    one = write_plan(plan, list(FORMATS), tmp_path / "one", "two")
    other = write_plan(plan, list(FORMATS), tmp_path / "other", "two")
    assert [file.read_bytes() for file in one] == [file.read_bytes() for file in other]
    assert not ezdxf.options.write_fixed_meta_data_for_testing


def test_the_same_plan_gives_the_same_dxf_in_every_process(tmp_path: Path):
    """Whatever the order of sets, which Python seeds anew in each; these two seeds gave two files."""
    script = (
        "import sys; from pathlib import Path; from drawn_plans import two_rooms_plan; "
        "from rose2_logs.outputs.exports.dxf import write_dxf; write_dxf(two_rooms_plan(), Path(sys.argv[1]))"
    )
    written = set()
    for seed in (3, 4):
        file = tmp_path / f"{seed}.dxf"
        surroundings = os.environ | {
            "PYTHONHASHSEED": str(seed),
            "PYTHONPATH": os.pathsep.join(sys.path),
        }
        subprocess.run([sys.executable, "-c", script, str(file)], env=surroundings, check=True)
        written.add(file.read_bytes())
    assert len(written) == 1


def values_in(image: Path) -> np.ndarray:
    return np.flipud(np.asarray(Image.open(image)))


def test_labeled_map_is_read_as_a_map(plan, tmp_path: Path, caplog):
    """It has the rooms as values; our reader of map_server's files gets the map again, and its place."""
    image, about, listing, labels = write_plan(plan, ["map_server"], tmp_path, "two")
    with open_log(about) as log:
        (snapshot,) = log.snapshots()
    geometry = plan.map.geometry
    assert snapshot.geometry.shape == geometry.shape
    assert snapshot.geometry.origin_xy_m == pytest.approx(geometry.origin_xy_m)
    assert snapshot.geometry.yaw_rad == pytest.approx(geometry.yaw_rad)
    rooms = {each["room"]: each for each in yaml.safe_load(listing.read_text())["rooms"]}
    for number in (LEFT, RIGHT):
        assert ((plan.map.labels == number) == (values_in(image) == rooms[number]["value"])).all()
    outside = plan.map.labels == 0
    assert np.array_equal(snapshot.cells[outside], plan.map.cells[outside])
    assert (snapshot.cells[~outside] == 0).all()
    assert "are the rooms of an exported plan; they are read as free" in caplog.text
    assert rooms[LEFT]["neighbors"] == [RIGHT]
    assert image.read_bytes().startswith(b"P5")
    assert np.array_equal(np.flipud(np.asarray(Image.open(labels))), plan.map.labels)


def test_more_rooms_than_values_are_still_told_apart(tmp_path: Path, caplog):
    """The map that map_server loads has 99 values for them, the image of numbers has one for each."""
    plan = two_rooms_plan()
    numbers = range(201, 501)
    labels = np.zeros((40, 60), np.int32)
    labels[:30, :10] = np.arange(201, 501).reshape(30, 10)
    rooms = tuple(dataclasses.replace(plan.rooms[0], number=number) for number in numbers)
    geometry = GridGeometry(0.05, (1.0, 2.0), 0.0, "map", labels.shape)
    below = PlanMap(geometry, np.zeros(labels.shape, np.int8), labels)
    many = dataclasses.replace(plan, rooms=rooms, doorways=(), map=below)
    image, about, listing, apart = write_plan(many, ["map_server"], tmp_path, "many")
    assert "300 rooms share the 99 values" in caplog.text
    assert apart.name in caplog.text
    assert np.array_equal(np.flipud(np.asarray(Image.open(apart))), labels)
    values = {each["room"]: each["value"] for each in yaml.safe_load(listing.read_text())["rooms"]}
    assert yaml.safe_load(listing.read_text())["labels"] == apart.name
    assert set(values.values()) == set(range(1, 100))
    with open_log(about) as log:
        cells = log.first().cells
    assert all((values_in(image)[labels == number] == values[number]).all() for number in numbers)
    assert (cells[labels == 0] == 0).all()
    assert image.read_bytes().startswith(b"P5")


def test_free_and_occupied_are_what_they_were_in_the_analysis(tmp_path: Path):
    """Cells of 30 % are unknown by map_server's thresholds, and free by those of this plan."""
    plan = two_rooms_plan()
    cells, beside = plan.map.cells.copy(), (slice(0, 5), slice(0, 5))
    cells[beside] = 30
    for used, value in ((OccupancyParameters(), -1), (OccupancyParameters(free_max_percent=40.0), 0)):
        below = dataclasses.replace(plan.map, cells=cells, occupancy=used)
        folder = tmp_path / str(value)
        folder.mkdir()
        files = write_plan(dataclasses.replace(plan, map=below), ["map_server"], folder, "map")
        with open_log(files[1]) as log:
            assert (log.first().cells[beside] == value).all()


@pytest.mark.parametrize("kind", ["geojson", "dxf"])
def test_only_the_rooms_that_a_person_named_have_names_in_a_plan(kind: str, tmp_path: Path):
    """The others are called by their numbers there, which may be those of other rooms in another run."""
    plan = two_rooms_plan()
    (file,) = write_plan(plan, [kind], tmp_path, "unnamed")
    with pytest.raises(ParameterError, match="holds no name"):
        read_room_names(file)
    rooms = [dataclasses.replace(room, given_name="Kitchen" * (room.number == RIGHT)) for room in plan.rooms]
    (file,) = write_plan(dataclasses.replace(plan, rooms=tuple(rooms)), [kind], tmp_path, "named")
    names = read_room_names(file)
    assert set(names.of_place) == {"", "Kitchen"}
    wanted = tuple("Kitchen" * (room.number == RIGHT) for room in rooms)
    assert names.of((5, 6), tuple(room.shape for room in rooms)) == wanted
    assert names.unused(wanted, (5, 6)) == []


def test_graph_is_read_by_networkx(plan, tmp_path: Path):
    door = plan.doorways[0]
    twice = dataclasses.replace(plan, doorways=(door, dataclasses.replace(door, ends_m=door.ends_m + 0.1)))
    (file,) = write_plan(twice, ["graph"], tmp_path, "two")
    graph = nx.node_link_graph(json.loads(file.read_text()), edges="edges")
    assert (graph.is_multigraph(), graph.is_directed()) == (True, False)
    assert list(graph.nodes) == [LEFT, RIGHT]
    assert graph.nodes[LEFT]["name"] == "Room 3"
    assert graph.number_of_edges(LEFT, RIGHT) == 2
    assert graph.edges[LEFT, RIGHT, 0]["width_m"] == pytest.approx(1.0)


def test_without_ezdxf_a_line_says_what_to_install(plan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Before any other file is written, also where names are read from a drawing."""
    (drawing,) = write_plan(plan, ["dxf"], tmp_path, "two")
    monkeypatch.setitem(sys.modules, "ezdxf", None)
    told = r"^DXF files need ezdxf, which is not installed: pip install 'rose2-logs\[dxf\]'$"
    with pytest.raises(MissingPackageError, match=told):
        write_plan(plan, ["geojson", "dxf"], tmp_path / "none", "two")
    assert not (tmp_path / "none").exists()
    with pytest.raises(MissingPackageError, match=told):
        read_room_names(drawing)


def test_svg_is_xml(plan, tmp_path: Path):
    (file,) = write_plan(plan, ["svg"], tmp_path, "two")
    assert ET.parse(file).getroot().tag.endswith("svg")


def test_a_real_plan_is_read_back(real_plan, tmp_path: Path):
    """All rooms, doorways and walls of a run's last map, in every format."""
    write_plan(real_plan, list(FORMATS), tmp_path, "real")
    document = ezdxf.readfile(tmp_path / "real.floor_plan.dxf")
    assert not document.audit().errors
    space = document.modelspace()
    assert len(space.query('LINE[layer=="DOORWAYS"]')) == len(real_plan.doorways) > 5
    assert 10 < len(space.query('LWPOLYLINE[layer=="WALLS"]')) < len(real_plan.walls_m) / 5
    features = json.loads((tmp_path / "real.floor_plan.geojson").read_text())["features"]
    areas = {
        each["properties"]["room"]: shape(each["geometry"]).area
        for each in features
        if each["properties"]["kind"] == "room"
    }
    assert areas == pytest.approx({room.number: room.predicted_area_m2 for room in real_plan.rooms}, rel=1e-3)
    assert all(shape(each["geometry"]).is_valid for each in features)
    graph = nx.node_link_graph(json.loads((tmp_path / "real.graph.json").read_text()), edges="edges")
    neighbors = {room.number: sorted(set(graph.neighbors(room.number))) for room in real_plan.rooms}
    assert neighbors == {room.number: list(room.neighbors) for room in real_plan.rooms}


def test_an_unknown_format_is_named(plan, tmp_path: Path):
    with pytest.raises(ParameterError, match="choose one of geojson, qgis, svg, dxf, map_server, graph"):
        planned_files(["pdf"], tmp_path, "two")


def test_a_folder_that_cannot_be_made_is_named(plan, tmp_path: Path):
    (tmp_path / "taken").write_text("")
    for name in FORMATS:
        with pytest.raises(OutputError, match="taken"):
            write_plan(plan, [name], tmp_path / "taken", "two")
