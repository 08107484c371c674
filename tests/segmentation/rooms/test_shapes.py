"""Predicted shapes of drawn rooms; cells of 5 cm, positions in meters."""

import dataclasses

import cv2
import numpy as np
import pytest
import shapely
from finished_runs import SAMPLE_LOGS
from shapely.affinity import rotate

import rose2_logs as rl
from rose2_logs.config.floor_plan import FloorPlanParameters
from rose2_logs.segmentation.rooms.shapes import room_shapes, seen_cells

PARAMETERS = FloorPlanParameters()
CELL_M = 0.05
SIZE_M = 24.0


class Drawing:
    """A map on which boxes are drawn; faces of the floor plan are drawn, too."""

    def __init__(self) -> None:
        cells = round(SIZE_M / CELL_M)
        self.labels, self.face_of_cell = (np.zeros((cells, cells), np.int32) for _ in range(2))
        self.occupied = np.zeros((cells, cells), bool)
        self.room_of_face: list[int] = []

    def seen(self, room: int, *box_m: float) -> None:
        self.labels[self._cells(box_m)] = room
        self.occupied[self._cells(box_m)] = False

    def unseen(self, *box_m: float) -> None:
        self.labels[self._cells(box_m)] = 0

    def wall(self, *box_m: float) -> None:
        self.labels[self._cells(box_m)], self.occupied[self._cells(box_m)] = 0, True

    def face(self, room: int, *box_m: float) -> None:
        self.room_of_face.append(room)
        self.face_of_cell[self._cells(box_m)] = len(self.room_of_face)

    def turned(self, angle_deg: float) -> "Drawing":
        """The drawing turned about its middle."""
        other = Drawing()
        middle = self.labels.shape[1] / 2 - 0.5, self.labels.shape[0] / 2 - 0.5
        turn = cv2.getRotationMatrix2D(middle, -angle_deg, 1.0)
        for name in ("labels", "face_of_cell", "occupied"):
            image = getattr(self, name)
            moved = cv2.warpAffine(image.astype(np.float32), turn, image.shape[::-1], flags=cv2.INTER_NEAREST)
            setattr(other, name, moved.astype(image.dtype))
        other.room_of_face = self.room_of_face
        return other

    def shapes(self, **changes: float):
        parameters = dataclasses.replace(PARAMETERS, **changes)
        rooms = np.array(self.room_of_face, np.int32)
        free = self.labels > 0
        cells = seen_cells(self.labels, free, self.face_of_cell, len(rooms))
        return room_shapes(
            self.labels, free, self.occupied, self.face_of_cell, cells, rooms, CELL_M, parameters
        )

    @staticmethod
    def _cells(box_m: tuple[float, ...]) -> tuple[slice, slice]:
        x0, y0, x1, y1 = (round(value / CELL_M) for value in box_m)
        return slice(y0, y1), slice(x0, x1)


def half_seen_room() -> Drawing:
    """A room of 6 m by 4 m whose left half was seen, with the walls around it."""
    drawing = Drawing()
    drawing.face(1, 7.95, 7.95, 14.05, 12.05)
    drawing.wall(7.9, 7.9, 11.0, 12.1)
    drawing.seen(1, 8, 8, 11, 12)
    return drawing


def iou(one, other) -> float:
    return one.intersection(other).area / one.union(other).area


def test_the_other_half_of_a_room_is_predicted():
    (shape,) = half_seen_room().shapes()
    assert iou(shape, shapely.box(8, 8, 14, 12)) > 0.95


@pytest.mark.parametrize("angle_deg", [30, 77, 90])
def test_a_shape_turns_with_the_map(angle_deg: float):
    drawing = half_seen_room()
    (shape,), (turned,) = drawing.shapes(), drawing.turned(angle_deg).shapes()
    assert iou(rotate(shape, angle_deg, (SIZE_M / 2, SIZE_M / 2)), turned) > 0.96


@pytest.mark.parametrize("gap_m", [0.0, 0.15])
def test_a_wall_across_the_unseen_half_ends_a_room(gap_m: float):
    drawing = half_seen_room()
    drawing.wall(12.5, 7.9, 12.6, 12.1)
    drawing.occupied[drawing._cells((12.5, 9.5, 12.6, 9.5 + gap_m))] = False
    (shape,) = drawing.shapes()
    assert iou(shape, shapely.box(8, 8, 12.5, 12)) > 0.93
    assert shape.bounds[2] < 12.9


def test_another_room_ends_a_room():
    drawing = half_seen_room()
    drawing.face(2, 12, 6, 16, 14)
    drawing.seen(2, 12, 6, 16, 14)
    one, two = drawing.shapes()
    assert iou(one, shapely.box(8, 8, 12, 12)) > 0.93
    assert iou(two, shapely.box(12, 6, 16, 14)) > 0.98
    assert one.intersection(two).area < 0.01


@pytest.mark.parametrize("reach_m", [1.5, 3.0])
def test_a_room_ends_some_meters_beyond_what_was_seen(reach_m: float):
    drawing = Drawing()
    drawing.face(1, 1, 8, 23, 12)
    drawing.seen(1, 1, 8, 8, 12)
    (shape,) = drawing.shapes(shape_reach_m=reach_m)
    assert iou(shape, shapely.box(1, 8, 8 + reach_m, 12)) > 0.98


@pytest.mark.parametrize("room_of_courtyard", [0, 1])
def test_a_corridor_around_a_courtyard_has_the_shape_of_the_corridor(room_of_courtyard: int):
    drawing = Drawing()
    drawing.face(1, 2, 2, 22, 22)
    drawing.wall(1.9, 1.9, 22.1, 22.1)
    drawing.seen(1, 2, 2, 22, 22)
    drawing.wall(4, 4, 20, 20)
    drawing.occupied[drawing._cells((4.1, 4.1, 19.9, 19.9))] = False
    drawing.seen(1, 10, 4, 10.1, 4.1)  # a gap in the wall
    if room_of_courtyard == 0:
        drawing.face(0, 4.05, 4.05, 19.95, 19.95)
    (shape,) = drawing.shapes()
    corridor = shapely.box(2, 2, 22, 22).difference(shapely.box(4, 4, 20, 20))
    assert iou(shape, corridor) > 0.9


def test_each_of_the_rooms_in_a_face_takes_what_is_nearest_to_it():
    drawing = Drawing()
    drawing.face(1, 4, 8, 16, 12)
    drawing.seen(1, 4, 8, 10, 10.5)
    drawing.seen(2, 10, 8, 16, 10.5)
    one, two = drawing.shapes()
    assert iou(one, shapely.box(4, 8, 10, 12)) > 0.97
    assert iou(two, shapely.box(10, 8, 16, 12)) > 0.97


@pytest.mark.parametrize(("side_m", "is_filled"), [(0.9, True), (1.3, False)])
def test_furniture_and_its_shadow_belong_to_the_room_and_walled_shafts_do_not(side_m: float, is_filled: bool):
    drawing = Drawing()
    drawing.seen(1, 4, 4, 12, 12)
    drawing.wall(7, 7, 7 + side_m, 7 + side_m)
    drawing.occupied[drawing._cells((7.1, 7.1, 6.9 + side_m, 6.9 + side_m))] = False
    (shape,) = drawing.shapes()
    assert shape.contains(shapely.Point(7 + side_m / 2, 7 + side_m / 2)) == is_filled


@pytest.mark.parametrize(("seen_m", "is_predicted"), [(0.8, True), (0.5, False)])
def test_nothing_is_predicted_in_a_face_that_was_hardly_seen(seen_m: float, is_predicted: bool):
    drawing = Drawing()
    drawing.face(1, 4, 8, 10, 12)
    drawing.seen(1, 4, 8, 4 + seen_m, 12)
    (shape,) = drawing.shapes()
    assert (shape.area > 8) == is_predicted


@pytest.mark.parametrize("seed", range(5))
def test_every_room_has_a_valid_shape_that_holds_its_cells(seed: int):
    rng = np.random.default_rng(seed)
    labels = rng.integers(0, 7, (6, 6)).astype(np.int32).repeat(10, 0).repeat(10, 1)
    labels[rng.random(labels.shape) < 0.02] = 0
    faces = np.arange(9, dtype=np.int32).reshape(3, 3).repeat(20, 0).repeat(20, 1)
    occupied = (labels == 0) & (rng.random(labels.shape) < 0.3)
    free, room_of_face = labels > 0, rng.integers(0, 7, 8).astype(np.int32)
    cells = seen_cells(labels, free, faces, len(room_of_face))
    shapes = room_shapes(labels, free, occupied, faces, cells, room_of_face, CELL_M, PARAMETERS)
    for room, shape in enumerate(shapes, start=1):
        row, column = np.nonzero(labels == room)
        held = shapely.contains_xy(shape, (column + 0.5) * CELL_M, (row + 0.5) * CELL_M)
        assert shape.is_valid
        assert held.mean() > 0.97
    overlaps = [one.intersection(two).area for one in shapes for two in shapes if one is not two]
    assert max(overlaps) < 0.01


def test_a_map_without_rooms_has_no_shapes():
    assert Drawing().shapes() == []


def test_every_part_of_a_shape_was_seen_somewhere():
    """Also beside other rooms, where parts of shapes meet."""
    with rl.open_log(SAMPLE_LOGS / "office.mcap") as reader:
        first = next(iter(reader.snapshots()))
    found = rl.segment(first)
    row, column = np.nonzero(found.labels)
    points = shapely.points(found.geometry.cell_centers(row, column))
    seen = shapely.STRtree(points)
    for number, polygon in enumerate(found.polygons, start=1):
        for part in shapely.get_parts(polygon):
            near = seen.query(part, predicate="dwithin", distance=found.geometry.resolution_m)
            assert (found.labels[row[near], column[near]] == number).any()
