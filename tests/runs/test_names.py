"""Names of rooms in the outputs of a run, given by track, by point, or by the plan of an architect."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path

import ezdxf
import numpy as np
import pytest
import shapely

from rose2_logs.config.parameters import Parameters
from rose2_logs.errors import ParameterError
from rose2_logs.model.occupancy import GridGeometry, OccupancySnapshot
from rose2_logs.outputs.exports.formats import write_plan
from rose2_logs.outputs.exports.geojson import plan_geojson
from rose2_logs.runs.names import names_in
from rose2_logs.runs.run import Run, named_run


@pytest.fixture
def run(office_results: Path) -> Run:
    return Run(office_results)


def test_a_plan_in_a_frame_of_its_own_names_each_room(run: Run, tmp_path: Path):
    """Turned and moved, as a drawing is; every room gets the name of its outline and no other."""
    turn = 0.8
    rotation = np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
    content = plan_geojson(run[-1].plan())
    rooms = [each for each in content["features"] if each["properties"]["kind"] == "room"]
    for feature in rooms:
        moved = shapely.transform(
            shapely.geometry.shape(feature["geometry"]), lambda xy: xy @ rotation + (70, -40)
        )
        feature["geometry"] = shapely.geometry.mapping(moved)
        feature["properties"]["name"] = f"No. {feature['properties']['room']}"
    file = tmp_path / "drawn.geojson"
    file.write_text(json.dumps(content | {"features": rooms}))
    named = named_run(run.folder, file)
    assert {room.number: room.name for room in named[-1].plan().rooms} == {
        room.number: f"No. {room.number}" for room in run[-1].plan().rooms
    }


def test_a_drawing_names_rooms_by_the_texts_in_their_outlines(run: Run, tmp_path: Path):
    """That which is exported, with other texts, in millimeters; areas below the names are no names."""
    plan = run[-1].plan()
    named = tuple(dataclasses.replace(room, given_name=f"No. {room.number}") for room in plan.rooms)
    (file,) = write_plan(dataclasses.replace(plan, rooms=named), ["dxf"], tmp_path, "drawn")
    document = ezdxf.readfile(file)
    for entity in document.modelspace():
        entity.scale_uniform(1000)
    document.units = ezdxf.units.MM
    document.saveas(file)
    names = {room.number: room.name for room in named_run(run.folder, file)[-1].plan().rooms}
    assert names == {room.number: room.name for room in named}


@pytest.mark.parametrize("turned", [False, True])
def test_a_plan_that_fits_in_two_ways_is_told_unless_it_lies_where_it_belongs(turned, tmp_path: Path, caplog):
    """Two equal rooms beside each other look the same turned by half a circle."""
    cells = np.full((120, 240), -1, np.int8)
    cells[10:110, 10:230] = 100
    cells[12:108, 12:118] = cells[12:108, 122:228] = 0
    cells[50:70, 118:122] = 0
    last = OccupancySnapshot(0, 0, 0, "map", cells, GridGeometry(0.05, (0.0, 0.0), 0.0, "map", cells.shape))
    boxes = [shapely.box(0.6, 0.6, 5.9, 5.4), shapely.box(6.1, 0.6, 11.4, 5.4)]
    if turned:
        boxes = [shapely.transform(box, lambda xy: xy @ [[0, 1], [-1, 0]] + (40, 7)) for box in boxes]
    features = [
        {"type": "Feature", "geometry": shapely.geometry.mapping(box), "properties": {"name": name}}
        for box, name in zip(boxes, ("Left", "Right"), strict=True)
    ]
    file = tmp_path / "plan.geojson"
    file.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    names = names_in(last, file, Parameters(), Parameters().occupancy)
    assert set(names.of_place) == {"Left", "Right"}
    assert ("in another way" in caplog.text) == turned


def test_a_plan_of_another_building_is_refused(run: Run, tmp_path: Path):
    boxes = [shapely.box(7 * x, 0, 7 * x + 6, 40 + x) for x in range(3)]
    features = [
        {"type": "Feature", "geometry": shapely.geometry.mapping(box), "properties": {"name": "x"}}
        for box in boxes
    ]
    file = tmp_path / "other.geojson"
    file.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    with pytest.raises(ParameterError, match="do not fit the walls of the last map"):
        run.rename(file)


def test_names_are_kept_with_the_run_until_others_are_given(run: Run, tmp_path: Path, caplog):
    first, second = (room for room in run[-1].plan().rooms[:2])
    x, y = second.label_point_m
    file = tmp_path / "names.csv"
    file.write_text(f"name,track,x,y\nKitchen,{first.number},,\nHall,,{x},{y}\nNowhere,,999,999\n")
    run.rename(file)
    assert (run.name_of(first.number), run.name_of(second.number)) == ("Kitchen", "Hall")
    assert "no room has these names: 'Nowhere'" in caplog.text
    assert Run(run.folder).name_of(first.number) == f"Room {first.number}"


def test_kinds_are_guessed_in_the_tables(run: Run):
    """The sample has one corridor along all of its rooms."""
    kinds = dict(zip(run.tracks.track, run.tracks.kind_guess, strict=True))
    last = {room.number: room for room in run[-1].plan().rooms}
    longest = max(last.values(), key=lambda room: room.shape.minimum_rotated_rectangle.length)
    assert kinds[longest.number] == "corridor"
    assert {kinds[number] for number in last if number != longest.number} == {"room"}
