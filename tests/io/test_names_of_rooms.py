"""Files of names are read for what they say; what cannot be used is named with its line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import shapely

from rose2_logs.errors import ParameterError
from rose2_logs.io.room_names import read_room_names


@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_a_table_names_tracks_and_points(tmp_path: Path, separator: str):
    """In any order of columns, as spreadsheets write it, with a mark at the beginning and empty lines."""
    rows = [
        ("x", "Track", "name", "y"),
        ("", "3", " Great  hall", ""),
        ("", "", "", ""),
        ("1.5", "", "Küche", "-2"),
    ]
    file = tmp_path / "names.csv"
    file.write_text("\r\n".join(separator.join(row) for row in rows), encoding="utf-8-sig")
    names = read_room_names(file)
    assert names.by_track == {3: "Great hall"}
    assert [point.coords[0] for point in names.places] == [(1.5, -2.0)]
    assert names.of_place == ("Küche",)


def test_a_plan_names_outlines(tmp_path: Path):
    """Features without a name or an area are left out, as those of an exported plan are."""
    kitchen = shapely.box(0, 0, 4, 3)

    def feature(shape, **properties):
        return {"type": "Feature", "geometry": shapely.geometry.mapping(shape), "properties": properties}

    features = [
        feature(kitchen, name="Kitchen"),
        feature(shapely.box(4, 0, 5, 1), name=""),
        feature(shapely.box(5, 0, 6, 1), name="Room 3", room=3.0),
        feature(shapely.LineString([(0, 0), (1, 1)]), name="door"),
        {"type": "Feature", "geometry": None, "properties": None},
    ]
    file = tmp_path / "plan.geojson"
    file.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    names = read_room_names(file)
    assert names.of_place == ("Kitchen", "")
    assert names.places[0].equals(kitchen)


@pytest.mark.parametrize(
    ("name", "content", "told"),
    [
        ("a.csv", b"", "needs a first line"),
        ("a.csv", b"room,label\n1,x\n", "needs a first line with the columns name and track"),
        ("a.csv", b"name,track\nKitchen,two\n", "line 2: the track is 'two'"),
        ("a.csv", b"name,track\nKitchen,0\n", "line 2: the track is '0'"),
        ("a.csv", b"name,track\n,4\n", "line 2: has no name"),
        ("a.csv", b"name,track\nKitchen,4\nHall,4\n", "line 3: track 4 has another name"),
        ("a.csv", b"name,x,y\nKitchen,1,nan\n", "line 2: y is 'nan'"),
        ("a.csv", b"name,x,y\nKitchen,1\n", "line 2: y is ''"),
        ("a.csv", b"name,x,y\n", "holds no name"),
        ("a.csv", b"\xff\xfe\x00", "no text in UTF-8"),
        ("a.dxf", b"no drawing\n", "is no DXF of outlines"),
        ("a.geojson", b"{", "is no GeoJSON of outlines"),
        ("a.geojson", b"[1]", "is no GeoJSON of outlines"),
        ("a.geojson", b'{"features": []}', "holds no name"),
    ],
)
def test_what_cannot_be_used_is_told_in_one_line(tmp_path: Path, name: str, content: bytes, told: str):
    file = tmp_path / name
    file.write_bytes(content)
    with pytest.raises(ParameterError) as caught:
        read_room_names(file)
    assert told in str(caught.value)
    assert str(file) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there_is_named(tmp_path: Path):
    with pytest.raises(ParameterError, match="No such file"):
        read_room_names(tmp_path / "none.csv")
