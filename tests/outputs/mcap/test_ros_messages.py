"""The messages of the annotated MCAP, byte for byte what rosbags' own serializer makes of the same fields."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import shapely
from drawn_maps import office, snapshot
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from rose2_logs.config.parameters import Parameters
from rose2_logs.config.tracking import TrackingParameters
from rose2_logs.model.occupancy import GridGeometry
from rose2_logs.model.outlines import outer_rings, outline
from rose2_logs.model.rooms import RoomMap
from rose2_logs.outputs.mcap.ros_messages import (
    ROOMS_TYPE,
    MarkerSizes,
    MessageMaker,
    Triangles,
    definition,
    ring_segments,
    room_value,
    ros2_typestore,
)
from rose2_logs.segmentation.pipeline import METHODS, analyze
from rose2_logs.tracking.tracked_snapshot import TrackedSnapshot
from rose2_logs.tracking.tracker import RoomTracker

GRID = "nav_msgs/msg/OccupancyGrid"
KINDS = {
    "markers": "visualization_msgs/msg/MarkerArray",
    "rooms": ROOMS_TYPE,
    "segmented_map": GRID,
    "clean_map": GRID,
    "source_map": GRID,
}


@pytest.fixture(scope="module", params=METHODS[:2])
def step(request) -> TrackedSnapshot:
    """The drawn office turned, moved and half unknown, with structure and without."""
    cells, _ = office(turn_rad=0.2, clutter=8)
    cells[:, 170:] = -1
    taken = snapshot(cells, origin_xy_m=(-3.25, 7.5), yaw_rad=0.7)
    analysis = analyze(taken, Parameters(), request.param)
    ids, events = RoomTracker(TrackingParameters()).update(taken, analysis)
    assert len(ids) >= 2
    names = ("Küche", *[""] * (len(ids) - 1))
    return TrackedSnapshot(taken, analysis, 0.5, ids, events, names=names)


@pytest.mark.parametrize("kind", sorted(set(KINDS.values())))
def test_the_written_definitions_are_those_of_ros_2(kind: str):
    ros_2 = get_typestore(Stores.ROS2_HUMBLE)
    if kind == ROOMS_TYPE:
        ros_2.register(get_types_from_msg(definition(kind).decode(), kind))
    assert definition(kind).decode() == ros_2.generate_msgdef(kind, ros_version=2)[0]


@pytest.mark.parametrize("name", KINDS)
def test_each_message_is_what_another_serializer_writes(step: TrackedSnapshot, name: str):
    """Read by rosbags and written again, every byte comes back: fields, alignment, lengths."""
    store = ros2_typestore()
    written = getattr(MessageMaker(), name)(step)
    if written is None:
        assert (name, step.analysis.structure) == ("clean_map", None)
        return
    message = store.deserialize_cdr(written, KINDS[name])
    assert bytes(store.serialize_cdr(message, KINDS[name])) == written


def test_the_fields_stand_where_they_belong(step: TrackedSnapshot):
    store, maker, rooms = ros2_typestore(), MessageMaker(), step.analysis.rooms
    grid = store.deserialize_cdr(maker.segmented_map(step), GRID)
    geometry = step.analysis.geometry
    assert (grid.info.height, grid.info.width) == geometry.shape
    assert grid.info.resolution == pytest.approx(geometry.resolution_m)
    assert (grid.info.origin.position.x, grid.info.origin.position.y) == geometry.origin_xy_m
    assert 2 * np.arctan2(grid.info.origin.orientation.z, grid.info.origin.orientation.w) == pytest.approx(
        0.7
    )
    cells = np.asarray(grid.data).reshape(geometry.shape)
    for number, track in enumerate(step.track_ids, start=1):
        assert (cells[rooms.labels == number] == room_value(track)).all()
    outside = rooms.labels == 0
    np.testing.assert_array_equal(cells[outside], step.snapshot.cells[outside])

    told = store.deserialize_cdr(maker.rooms(step), ROOMS_TYPE)
    assert told.coverage == 0.5
    assert told.count == len(told.rooms) == len(rooms)
    assert (told.header.stamp.nanosec, told.header.frame_id) == (2, "map")
    for room in told.rooms:
        number = step.track_ids.index(room.track)
        assert room.area == rooms.areas_m2[number]
        assert room.name == step.names[number]
        shape = rooms.polygons[number]
        assert shape.contains(shapely.Point(room.label_point.x, room.label_point.y))
        corners = [[(point.x, point.y) for point in ring.points] for ring in room.outline]
        assert corners == [list(map(tuple, ring[:-1].tolist())) for ring in rooms.outer_rings_m[number]]

    markers = store.deserialize_cdr(maker.markers(step), KINDS["markers"]).markers
    by_name = {(marker.ns, marker.id): marker for marker in markers}
    assert markers[0].action == 3
    # RViz calls a marker without points an error.
    assert all(len(marker.points) > 0 for marker in markers[1:] if marker.ns != "labels")
    for track, shape in zip(step.track_ids, rooms.polygons, strict=True):
        fill, line = by_name["rooms", track], by_name["outlines", track]
        corners = np.array([(point.x, point.y) for point in fill.points]).reshape(-1, 3, 2)
        assert shapely.area(shapely.polygons(corners)).sum() == pytest.approx(shape.area)
        ends = np.array([(point.x, point.y) for point in line.points]).reshape(-1, 2, 2)
        assert np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum() == pytest.approx(shape.exterior.length)
        called = step.names[step.track_ids.index(track)] or track
        assert by_name["labels", track].text.startswith(f"{called}\n")


def test_a_shape_that_stays_gives_the_same_triangles_again(step: TrackedSnapshot):
    """Those of the map before are used again, and nothing of the message differs."""
    maker = MessageMaker()
    assert maker.markers(step) == maker.markers(step) == MessageMaker().markers(step)


def test_rings_of_shapes_with_parts_and_holes():
    """Each part gives its outer ring, holes none, an empty shape nothing."""
    square = shapely.box(0, 0, 3, 3).difference(shapely.box(1, 1, 2, 2))
    both = shapely.union_all([square, shapely.box(5, 0, 6, 1)])
    assert sorted(len(ring) for ring in outer_rings(both)) == [5, 5]
    assert ring_segments(outer_rings(both)).shape == (16, 2)
    assert outer_rings(shapely.Polygon()) == []
    shapes = (shapely.Polygon(), both, shapely.Polygon(), square)
    rooms = RoomMap(GridGeometry(1.0, (0.0, 0.0), 0.0, "map", (1, 1)), np.zeros((1, 1), np.int32), shapes, [])
    for shape, rings in zip(shapes, rooms.outer_rings_m, strict=True):
        assert [ring.tolist() for ring in rings] == [ring.tolist() for ring in outer_rings(shape)]
    assert ring_segments([]).shape == (0, 2)


def test_values_of_the_segmented_map_differ_and_those_of_neighbors_do_so_clearly():
    """As far as there are values: the 99th track shares that of the first."""
    values = np.array([room_value(track) for track in range(1, 99)])
    assert sorted(values) == list(range(1, 99))
    assert np.abs(np.diff(values)).min() >= 30
    assert room_value(99) == room_value(1)


def test_sizes_of_markers_grow_with_the_building():
    """What can be read in a picture of a small building can be read in one of a large building."""
    small, large = MarkerSizes.of_view(5.0), MarkerSizes.of_view(200.0)
    assert small == MarkerSizes()
    assert large.label_m > 3 > small.label_m
    assert MarkerSizes.of_view(400.0).doorway_m == pytest.approx(2 * large.doorway_m)


def test_the_path_is_drawn_in_its_pieces(step: TrackedSnapshot):
    """A piece of one point is no line."""
    pieces = [np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 2.0]]), np.array([[5.0, 5.0]]), np.eye(2)]
    written = MessageMaker().markers(step, pieces, MarkerSizes(path_m=0.2))
    found = ros2_typestore().deserialize_cdr(written, KINDS["markers"]).markers
    path = [marker for marker in found if marker.ns == "path"]
    assert [(marker.type, marker.scale.x) for marker in path] == [(4, 0.2), (4, 0.2)]
    assert [[(point.x, point.y) for point in marker.points] for marker in path] == [
        [(0.0, 0.0), (1.0, 0.0), (1.0, 2.0)],
        [(1.0, 0.0), (0.0, 1.0)],
    ]


def test_triangles_fill_any_outline_of_cells():
    """And they go around counterclockwise: seen from above, RViz draws others without their color."""
    rng = np.random.default_rng(3)
    for _ in range(60):
        shape = outline(rng.random((14, 14)) < rng.uniform(0.3, 0.9), 0.05)
        corners, none = Triangles().corners_of([shape, shapely.Polygon()])
        one, two, three = corners.reshape(-1, 3, 2).transpose(1, 0, 2)
        (ax, ay), (bx, by) = (two - one).T, (three - one).T
        assert (ax * by - ay * bx >= 0).all()
        found = shapely.polygons(corners.reshape(-1, 3, 2))
        assert shapely.area(found).sum() == pytest.approx(shape.area, rel=0.05)
        assert shapely.area(shapely.union_all(found).symmetric_difference(shape)) < 0.05 * shape.area
        assert none.shape == (0, 2)


def test_triangles_fill_four_corners_of_any_kind():
    """Boxes, as most parts of rooms are, and one whose corner points inwards."""
    shapes = [
        shapely.box(0, 0, 2, 1),
        shapely.Polygon([(0, 0), (0, 1), (3, 1), (2, 0)]),
        shapely.Polygon([(0, 0), (4, 0), (1, 1), (0, 4)]),
        shapely.MultiPolygon([shapely.box(0, 0, 1, 1), shapely.box(5, 0, 6, 2)]),
    ]
    maker = Triangles()
    for again in (shapes, shapes[2:]):
        for shape, corners in zip(again, maker.corners_of(again), strict=True):
            found = shapely.union_all(shapely.polygons(corners.reshape(-1, 3, 2)))
            assert len(corners) == 6 * len(shapely.get_parts(shape))
            assert found.symmetric_difference(shape).area == pytest.approx(0.0, abs=1e-9)


def test_probabilities_between_rooms_do_not_look_like_rooms(step: TrackedSnapshot):
    """Beside rooms the segmented map knows free, occupied and what is neither."""
    outside = np.argwhere(step.analysis.rooms.labels == 0)[:3]
    cells = step.snapshot.cells.copy()
    cells[tuple(outside.T)] = 5, 40, 90
    changed = dataclasses.replace(step, snapshot=dataclasses.replace(step.snapshot, cells=cells))
    grid = ros2_typestore().deserialize_cdr(MessageMaker().segmented_map(changed), GRID)
    assert np.asarray(grid.data).reshape(cells.shape)[tuple(outside.T)].tolist() == [0, -1, 100]
