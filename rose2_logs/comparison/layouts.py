"""Two final layouts laid over each other, and all that differs."""

from __future__ import annotations

import dataclasses
from collections import Counter
from dataclasses import dataclass
from functools import cached_property

import shapely

from rose2_logs.comparison.final_layout import FinalLayout
from rose2_logs.comparison.placement import Placement, fits, fitting_scale, is_ambiguous, place
from rose2_logs.comparison.room_changes import RoomChange, RoomStatus, compare_rooms
from rose2_logs.comparison.wall_changes import WallComparison, compare_walls


@dataclass(frozen=True, eq=False)
class LayoutComparison:
    """What differs between two layouts, in A's frame.

    Attributes
    ----------
    a, b : FinalLayout
        The layouts.
    placement : Placement
        Brings B's frame into A's.
    rooms : tuple of RoomChange
        Every room of both.
    walls : WallComparison or None
        None where a method found no walls.
    scale : float, optional
        Where they do not seem to show one building: how many times larger B would have to be to lie over A.

    Examples
    --------
    >>> import rose2_logs as rl
    >>> run = rl.analyze("sample_logs/office.mcap", max_snapshots=3)
    >>> found = rl.compare(run, run)
    >>> found.same_building, found.room_counts
    (True, {'same': 18})
    """

    a: FinalLayout
    b: FinalLayout
    placement: Placement
    rooms: tuple[RoomChange, ...]
    walls: WallComparison | None
    scale: float | None = None

    def __repr__(self) -> str:
        rooms = ", ".join(f"{count} {status}" for status, count in self.room_counts.items())
        doubt = "" if self.same_building else "; not the same building"
        return f"LayoutComparison({self.a.name!r}, {self.b.name!r}, rooms: {rooms or 'none'}{doubt})"

    @property
    def same_building(self) -> bool:
        """Whether the two seem to show the same building."""
        return fits(self.placement, self.a.map.parameters.comparison)

    @property
    def ambiguous(self) -> bool:
        """Whether another placement fits about as well."""
        return is_ambiguous(self.placement, self.a.map.parameters.comparison)

    @property
    def doubts(self) -> list[str]:
        """What makes the comparison doubtful, in sentences; empty where nothing does."""
        if self.same_building:
            if not self.ambiguous:
                return []
            return [
                "the building fits about as well in another way, as when it looks the same turned by half a "
                "circle: B may be misaligned with A"
            ]
        doubts = [
            "these do not seem to be two runs in one building: their walls agree too little, and what is "
            "changed below means little"
        ]
        if self.scale is not None:
            cell_a_m, cell_b_m = self.a.map.resolution_m, self.b.map.resolution_m
            doubts.append(
                f"B would fit if it were {self.scale:.2f} times as large: is the size of a cell right? With "
                f"{cell_b_m * self.scale:.4f} m instead of {cell_b_m:.4f} m in B, or "
                f"{cell_a_m / self.scale:.4f} m instead of {cell_a_m:.4f} m in A, they show one building"
            )
        return doubts

    @property
    def room_counts(self) -> dict[RoomStatus, int]:
        """Number of entries of each status that occurs."""
        return dict(Counter(change.status for change in self.rooms))

    @cached_property
    def floor_iou(self) -> float:
        """Intersection over union of the floors of all rooms."""
        floors = [
            shapely.union_all(shapes)
            for shapes in (self.a.shapes, self.b.shapes_moved(self.placement.motion))
        ]
        union = float(shapely.area(shapely.union(*floors)))
        return float(shapely.area(shapely.intersection(*floors))) / union if union > 0 else 0.0

    @cached_property
    def rooms_iou(self) -> float:
        """Mean overlap of the rooms, by their area; 0 for one that the other layout does not have."""
        weights = [
            float(shapely.area(change.shape_a) + shapely.area(change.shape_b)) for change in self.rooms
        ]
        # Of several rooms that became one, the overlap of the whole says nothing: none is the same.
        overlaps = [
            change.iou if len(change.tracks_a) == len(change.tracks_b) == 1 else 0.0 for change in self.rooms
        ]
        total = sum(weights)
        return sum(w * o for w, o in zip(weights, overlaps, strict=True)) / total if total > 0 else 0.0


def compare_placed(a: FinalLayout, b: FinalLayout, placement: Placement) -> LayoutComparison:
    """Find what differs between two layouts that lie over each other."""
    rooms = compare_rooms(a, b, placement.motion)
    return LayoutComparison(a, b, placement, rooms, compare_walls(a, b, placement.motion))


def compare_layouts(a: FinalLayout, b: FinalLayout) -> LayoutComparison | None:
    """Align two layouts and find what differs.

    Returns
    -------
    LayoutComparison or None
        None where one of the maps has too few walls to be aligned.
    """
    placement = place(b.map, a.map)
    if placement is None:
        return None
    comparison = compare_placed(a, b, placement)
    if comparison.same_building:
        return comparison
    return dataclasses.replace(comparison, scale=fitting_scale(b.map, a.map))
