"""Which rooms of two layouts are the same, and how the others changed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from rose2_logs.comparison.final_layout import FinalLayout
from rose2_logs.config.comparison import ComparisonParameters
from rose2_logs.model.occupancy import BoolArray, FloatArray
from rose2_logs.model.regions import connected
from rose2_logs.tracking.matching import assign
from rose2_logs.tracking.overlap import share_of
from rose2_logs.tracking.registration import RigidMotion

RoomStatus = Literal[
    "same", "partly seen", "changed", "split", "merged", "regrouped", "missing", "new", "unseen"
]
ROOM_STATUSES: dict[RoomStatus, str] = {
    "same": "the shapes overlap by 0.8",
    "partly seen": "they do where both runs have explored",
    "changed": "one room in both runs, of another shape",
    "split": "one room of A is several of B",
    "merged": "several rooms of A are one of B",
    "regrouped": "several rooms of A are several others of B",
    "missing": "a room of A whose place B has explored without finding a room",
    "new": "a room of B whose place A has explored without finding a room",
    "unseen": "a room whose place the other run has not explored",
}
"""How rooms may have changed, and what each status means; in the order of the tables."""


@dataclass(frozen=True, eq=False)
class RoomChange:
    """Rooms of two layouts that belong together, or one alone. All shapes are in A's frame.

    Attributes
    ----------
    status : RoomStatus
        How they changed.
    tracks_a, tracks_b : tuple of int
        Their numbers in each run; empty where there is none.
    iou : float
        Overlap of all that is A's with all that is B's, intersection over union.
    explored_iou : float or None
        The same where both runs have explored; None where they nowhere have.
    explored_share : float
        Share of the place that both runs have explored.
    area_a_m2, area_b_m2 : float
        Area as far as it was seen.
    shape_a, shape_b : shapely geometry
        With the predicted part; empty where there is none.
    """

    status: RoomStatus
    tracks_a: tuple[int, ...]
    tracks_b: tuple[int, ...]
    iou: float
    explored_iou: float | None
    explored_share: float
    area_a_m2: float
    area_b_m2: float
    shape_a: BaseGeometry
    shape_b: BaseGeometry


def compare_rooms(a: FinalLayout, b: FinalLayout, b_to_a: RigidMotion) -> tuple[RoomChange, ...]:
    """Match the rooms of two layouts by the area they share.

    Rooms are paired so that the sum of squared overlaps is greatest; a room that is left over joins the one
    that holds most of it.

    Parameters
    ----------
    a, b : FinalLayout
    b_to_a : RigidMotion
        Brings B's frame into A's.

    Returns
    -------
    tuple of RoomChange
        In the order of `ROOM_STATUSES`, then of the numbers; each room is in one of them.
    """
    parameters = a.map.parameters.comparison
    shapes_a, shapes_b = a.shapes, b.shapes_moved(b_to_a)
    common = _common_areas(shapes_a, shapes_b)
    changes = []
    for rows, columns in _groups(common, shapely.area(shapes_a), shapely.area(shapes_b), parameters):
        shape_a = shapely.union_all([shapes_a[row] for row in rows])
        shape_b = shapely.union_all([shapes_b[column] for column in columns])
        iou = _share(shapely.area(shapely.intersection(shape_a, shape_b)), _union_area(shape_a, shape_b))
        explored_iou, explored_share = _explored(a, b, b_to_a, shape_a, shape_b)
        changes.append(
            RoomChange(
                _status(len(rows), len(columns), iou, explored_iou, explored_share, parameters),
                tuple(sorted(a.tracks[row] for row in rows)),
                tuple(sorted(b.tracks[column] for column in columns)),
                iou,
                explored_iou,
                explored_share,
                float(sum(a.areas_m2[row] for row in rows)),
                float(sum(b.areas_m2[column] for column in columns)),
                shape_a,
                shape_b,
            )
        )
    order = list(ROOM_STATUSES)
    changes.sort(key=lambda change: (order.index(change.status), change.tracks_a, change.tracks_b))
    return tuple(changes)


def _common_areas(ones: tuple[BaseGeometry, ...], others: tuple[BaseGeometry, ...]) -> FloatArray:
    """Area (A, B) in square meters that each pair of shapes shares."""
    common = np.zeros((len(ones), len(others)))
    if ones and others:
        first, second = np.array(ones, object), np.array(others, object)
        rows, columns = shapely.STRtree(second).query(first, predicate="intersects")
        common[rows, columns] = shapely.area(shapely.intersection(first[rows], second[columns]))
    return common


def _groups(
    common: FloatArray, sizes_a: FloatArray, sizes_b: FloatArray, parameters: ComparisonParameters
) -> list[tuple[list[int], list[int]]]:
    """Rows and columns that belong together: pairs, what is part of one of a pair, and single ones."""
    smaller = np.minimum(sizes_a[:, None], sizes_b[None])
    union = sizes_a[:, None] + sizes_b[None] - common
    iou = share_of(common, union)
    is_part: BoolArray = (common > 0) & (common >= parameters.part_min_share * smaller)
    pairs = assign(iou**2, (iou >= parameters.pair_min_iou) | is_part)
    links = set(pairs)
    paired_rows, paired_columns = {row for row, _ in pairs}, {column for _, column in pairs}
    links |= {
        (row, column)
        for row, column in zip(*np.nonzero(is_part), strict=True)
        if (row in paired_rows) != (column in paired_columns)
        # The one that is left over must be the part, not the whole.
        and (sizes_a[row] <= sizes_b[column] if row not in paired_rows else sizes_b[column] <= sizes_a[row])
    }
    return _components(links, len(sizes_a), len(sizes_b))


def _components(links: set[tuple[int, int]], rows: int, columns: int) -> list[tuple[list[int], list[int]]]:
    row, column = np.array(sorted(links), np.int64).reshape(-1, 2).T
    count, of_room = connected(rows + columns, row, rows + column)
    return [
        (np.flatnonzero(of_room[:rows] == part).tolist(), np.flatnonzero(of_room[rows:] == part).tolist())
        for part in range(count)
    ]


def _explored(
    a: FinalLayout, b: FinalLayout, b_to_a: RigidMotion, shape_a: BaseGeometry, shape_b: BaseGeometry
) -> tuple[float | None, float]:
    """Overlap of two shapes where both runs have explored, and the share of their place that this is."""
    whole = shapely.union(shape_a, shape_b)
    if whole.is_empty:
        return None, 0.0
    parameters = a.map.parameters.comparison
    low, high = np.reshape(whole.bounds, (2, 2))
    step_m = max(parameters.sample_m, float(np.sqrt(np.prod(high - low) / parameters.samples_max)))
    x, y = (np.arange(start + step_m / 2, end, step_m) for start, end in zip(low, high, strict=True))
    points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    inside_a, inside_b = (shapely.contains_xy(shape, points) for shape in (shape_a, shape_b))
    inside = inside_a | inside_b
    known = a.map.is_known(points) & b.map.is_known(b_to_a.inverse().points(points))
    both = np.count_nonzero(known & inside)
    if both == 0:
        return None, 0.0
    return np.count_nonzero(known & inside_a & inside_b) / both, both / np.count_nonzero(inside)


def _status(
    count_a: int,
    count_b: int,
    iou: float,
    explored_iou: float | None,
    explored_share: float,
    parameters: ComparisonParameters,
) -> RoomStatus:
    if count_a == 0 or count_b == 0:
        if explored_share < parameters.explored_min_share:
            return "unseen"
        return "missing" if count_a else "new"
    if count_a > 1 or count_b > 1:
        return "regrouped" if count_a > 1 and count_b > 1 else "merged" if count_a > 1 else "split"
    same = parameters.same_room_min_iou
    if iou >= same:
        return "same"
    return "partly seen" if explored_iou is not None and explored_iou >= same else "changed"


def _union_area(one: BaseGeometry, other: BaseGeometry) -> float:
    return float(shapely.area(shapely.union(one, other)))


def _share(part: float, whole: float) -> float:
    return float(part / whole) if whole > 0 else 0.0
