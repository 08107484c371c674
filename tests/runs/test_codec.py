"""Values to bytes and back: equal to the last bit, and nothing else is ever made of bytes."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from drawn_maps import office, snapshot
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from shapely.geometry import MultiPolygon, Polygon, box

from rose2_logs.config.parameters import Parameters
from rose2_logs.model.analysis import SnapshotAnalysis
from rose2_logs.model.occupancy import CellValues, GridGeometry
from rose2_logs.model.room_quality import RoomQuality
from rose2_logs.runs.codec import Codec, dataclasses_within
from rose2_logs.segmentation.pipeline import analyze

CODEC = Codec([SnapshotAnalysis, RoomQuality])


def assert_equal(one: object, other: object) -> None:
    """The same types and the same bits all the way down."""
    assert type(one) is type(other)
    if isinstance(one, np.ndarray):
        assert (one.dtype, one.shape, one.tobytes()) == (other.dtype, other.shape, other.tobytes())
    elif dataclasses.is_dataclass(one):
        for field in dataclasses.fields(one):
            assert_equal(getattr(one, field.name), getattr(other, field.name))
    elif isinstance(one, tuple | list):
        assert len(one) == len(other)
        for mine, its in zip(one, other, strict=True):
            assert_equal(mine, its)
    elif isinstance(one, dict):
        assert list(one) == list(other)
        assert_equal(list(one.values()), list(other.values()))
    elif isinstance(one, Polygon | MultiPolygon):
        assert one.wkb == other.wkb
    else:
        assert repr(one) == repr(other)


@pytest.mark.parametrize("method", ["rose2", "voronoi"])
def test_an_analysis_comes_back_as_it_was(method: str):
    cells, _ = office(turn_rad=0.3, clutter=5, pad=(7, 3))
    taken = snapshot(cells, origin_xy_m=(-3.1, 0.2), yaw_rad=0.1)
    analysis = analyze(taken, Parameters(), method)
    assert len(analysis.rooms) > 1
    assert analysis.quality is not None
    assert_equal(CODEC.decode(CODEC.encode(analysis)), analysis)


@given(
    arrays.arrays(
        st.sampled_from([np.bool_, np.int8, np.int32, np.uint8, np.int64, np.float32, np.float64]),
        arrays.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=5),
    )
)
def test_any_array_comes_back(array: np.ndarray):
    """Also empty ones, negative numbers, those that are not a number."""
    assert_equal(CODEC.decode(CODEC.encode(array)), array)


@pytest.mark.parametrize(
    "value",
    [
        (1, -2.5, "ä", None, True, float("inf"), 0.1 + 0.2),
        {"a": [1, (2, [3])], "b": {}},
        (Polygon(), box(0, 0, 1, 1), MultiPolygon([box(0, 0, 1, 1), box(2, 2, 3, 3)])),
        GridGeometry(0.05, (1.0, 2.0), 0.5, "map", (3, 4)),
        CellValues((9, 9), np.array([[1, 2], [3, 4]], np.int32), np.ones(2, np.float32)),
        np.float32(0.1),
        np.int64(7),
    ],
    ids=repr,
)
def test_what_an_analysis_is_made_of_comes_back(value: object):
    assert_equal(CODEC.decode(CODEC.encode(value)), value)


def test_the_known_types_are_those_of_the_annotations():
    names = set(dataclasses_within([SnapshotAnalysis, RoomQuality]))
    assert {"SnapshotAnalysis", "RoomMap", "Doorway", "Structure", "CellValues", "Walls", "FloorPlan"} < names


@pytest.mark.parametrize("value", [object(), Parameters(), {1, 2}, np.array([object()]), np.array(["a"])])
def test_other_things_are_refused(value: object):
    with pytest.raises(TypeError, match="cannot be encoded"):
        CODEC.encode(value)


@pytest.mark.parametrize(
    "text",
    [
        b'{"of":"Parameters","is":{}}',
        b'{"of":"Doorway","is":{"nothing":1}}',
        b'{"array":["|O",[1],null,"|O",[1],[0,8]]}',
        b'{"array":["<f8",[9],null,"<f8",[9],[0,8]]}',
        b'{"wkb":[0,8]}',
        b'{"other":1}',
        b"{",
    ],
)
def test_bytes_that_nobody_encoded_are_refused(text: bytes):
    """Another class, missing fields, an array of objects or of too few bytes, no geometry, no JSON."""
    with pytest.raises(ValueError):  # noqa: PT011
        CODEC.decode(len(text).to_bytes(4, "little") + text + bytes(8))
