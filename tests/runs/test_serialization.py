"""Values to bytes and back: equal to the last bit, and nothing else is ever made of bytes."""

from __future__ import annotations

import dataclasses
from typing import Any

import msgspec
import numpy as np
import pytest
from drawn_maps import office, snapshot
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from shapely.geometry import MultiPolygon, Polygon, box
from shapely.geometry.base import BaseGeometry

from rose2_logs.config.parameters import Parameters
from rose2_logs.model.analysis import SnapshotAnalysis
from rose2_logs.model.occupancy import CellValues, GridGeometry
from rose2_logs.runs.serialization import Serializer
from rose2_logs.segmentation.pipeline import analyze

ANALYSES: Serializer[SnapshotAnalysis] = Serializer(SnapshotAnalysis)
ARRAYS: Serializer[np.ndarray] = Serializer(np.ndarray)


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
    analysis = analyze(taken, method=method, voronoi=True)
    assert len(analysis.rooms) > 1
    assert_equal(ANALYSES.decode(ANALYSES.encode(analysis)), analysis)


def test_images_of_labels_stay_small():
    """Their used window alone is kept, a byte for each cell of few rooms."""
    labels = np.zeros((2000, 2000), np.int32)
    labels[900:1000, 800:1000] = 7
    data = ARRAYS.encode(labels)
    assert len(data) < 100 * 200 + 100
    assert_equal(ARRAYS.decode(data), labels)


@given(
    arrays.arrays(
        st.sampled_from([np.bool_, np.int8, np.int32, np.uint8, np.int64, np.float32, np.float64]),
        arrays.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=5),
    )
)
@example(np.array([[2**53 + 1, -1]]))
@example(np.array([[2**63 - 1, -(2**63)]]))
@example(np.array([[255, -1]]))
def test_any_array_comes_back(array: np.ndarray):
    """Also empty ones, negative numbers, those that are not a number."""
    assert_equal(ARRAYS.decode(ARRAYS.encode(array)), array)


@pytest.mark.parametrize(
    ("kind", "value"),
    [
        (tuple[float, str, None], (float("inf"), "ä", None)),
        (tuple[BaseGeometry, ...], (Polygon(), box(0, 0, 1, 1), MultiPolygon([box(0, 0, 1, 1)]))),
        (GridGeometry, GridGeometry(0.05, (1.0, 0.1 + 0.2), 0.5, "map", (3, 4))),
        (
            CellValues[np.float32],
            CellValues((9, 9), np.array([[1, 2], [3, 4]], np.int32), np.ones(2, np.float32)),
        ),
    ],
    ids=repr,
)
def test_what_an_analysis_is_made_of_comes_back(kind: Any, value: object):
    serializer: Serializer[object] = Serializer(kind)
    assert_equal(serializer.decode(serializer.encode(value)), value)


@pytest.mark.parametrize("value", [object(), np.array([object()]), np.array(["a"]), 1j])
def test_other_things_are_refused(value: object):
    with pytest.raises(TypeError):
        Serializer(Any).encode(value)


WKB = box(0, 0, 1, 1).wkb


@pytest.mark.parametrize(
    ("kind", "value"),
    [
        (np.ndarray, ["|O", [1], None, "|O", bytes(8)]),
        (np.ndarray, ["<f8", [9], None, "<f8", bytes(8)]),
        (np.ndarray, ["<i4", [9, 9], [0, 2, 0, 2], "|i1", bytes(3)]),
        (np.ndarray, ["<f8", [9]]),
        (np.ndarray, 5),
        (BaseGeometry, bytes(8)),
        (BaseGeometry, WKB[:-3]),
        (GridGeometry, {"resolution_m": 0.05}),
        (
            GridGeometry,
            {
                "resolution_m": -1.0,
                "origin_xy_m": [0.0, 0.0],
                "yaw_rad": 0.0,
                "frame_id": "map",
                "shape": [1, 1],
            },
        ),
        (Parameters, object),
        (SnapshotAnalysis, "a text"),
    ],
    ids=repr,
)
def test_bytes_that_nobody_encoded_are_refused(kind: Any, value: object):
    """An array of objects or of too few bytes, half a geometry, missing fields, another type."""
    data = b"\xc1" if value is object else msgspec.msgpack.encode(value)
    with pytest.raises(ValueError, match="not what was encoded"):
        Serializer(kind).decode(data)
