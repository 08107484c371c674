"""Stage B in one call, and the count of walls that stage A needs."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.parameters import WallParameters
from rose2_logs.model.occupancy import BoolArray, FloatArray
from rose2_logs.segmentation.walls.clusters import cluster_segments, group_segments
from rose2_logs.segmentation.walls.lines import RepresentativeLines, representative_lines
from rose2_logs.segmentation.walls.segments import (
    Segments,
    detect_segments,
    join_segments,
    local_directions,
    long_pieces,
)
from rose2_logs.segmentation.walls.strips import WallCells


@dataclass(frozen=True, eq=False)
class WallResult:
    """Stage B in the grid frame, meters.

    Attributes
    ----------
    segments_m : (N, 4) float
        All segments.
    segment_direction : (N,) int32
        Index of each segment's direction: first the dominant ones, then local ones, see `Segments`.
    segment_line : (N,) int32
        Representative line of each segment's wall cluster, -1 for none.
    lines : RepresentativeLines
        The representative lines.
    walls : (H, W) bool
        Wall cells: the clean map, what is attached to it, and the walls off the dominant directions.
    """

    segments_m: FloatArray
    segment_direction: NDArray[np.int32]
    segment_line: NDArray[np.int32]
    lines: RepresentativeLines
    walls: BoolArray


def find_walls(count_walls: WallCounter, clean: BoolArray, attached: BoolArray) -> WallResult:
    """Segments, wall clusters and representative lines of a clean map and what is attached to it.

    Parameters
    ----------
    count_walls : WallCounter
        Knows the cells that may be walls, and the dominant directions.
    clean, attached : (H, W) bool
        The clean map, chosen from them, and with what is attached to it.
    """
    supported, parameters = count_walls.supported, count_walls.parameters
    dominant_rad = supported.directions_rad
    # Off the dominant directions, only its length distinguishes a wall from furniture.
    length_m = parameters.local_segment_min_length_m
    rest = long_pieces(supported.cells & ~clean, supported.resolution_m, length_m, parameters)
    local, local_walls = detect_segments(count_walls.others(rest), rest, length_m, parameters)
    segments = join_segments(count_walls.segments(clean), local)
    clusters = cluster_segments(segments, parameters)
    lines = representative_lines(clusters, segments.directions_rad, len(dominant_rad), parameters)
    return WallResult(
        segments.ends_m,
        segments.direction,
        lines.of_cluster[clusters.of_segment],
        lines,
        attached | local_walls,
    )


@dataclass(frozen=True, eq=False)
class WallCounter:
    """Counts the walls of a clean map, as the search for its threshold asks.

    Attributes
    ----------
    supported : WallCells
        Cells that may be walls, and the dominant directions.
    parameters : WallParameters
    """

    supported: WallCells
    parameters: WallParameters
    _found: dict[int, Segments] = field(default_factory=dict)
    _others: list[WallCells] = field(default_factory=list)

    def __call__(self, clean: BoolArray) -> int:
        """Number of wall clusters along the dominant directions of a clean map (H, W)."""
        return group_segments(self.segments(clean), self.parameters)[0]

    def segments(self, clean: BoolArray) -> Segments:
        """Segments of a clean map (H, W) along the dominant directions.

        Of clean maps by a threshold each holds the next one: with as many cells they are the same.
        """
        count = int(np.count_nonzero(clean))
        if count not in self._found:
            length_m = self.parameters.segment_min_length_m
            self._found[count] = detect_segments(self.supported, clean, length_m, self.parameters)[0]
        return self._found[count]

    def others(self, rest: BoolArray) -> WallCells:
        """Cells and directions in which walls off the dominant directions are looked for in a rest (H, W).

        Those of another clean map, which are sorted already, if they hold the rest.
        """
        for others in self._others:
            if not (rest & ~others.cells).any():
                return others
        directions = local_directions(self.supported.directions_rad, self.parameters)
        self._others.append(WallCells(rest, directions, self.supported.resolution_m))
        return self._others[-1]
