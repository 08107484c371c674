"""Faces: the cells of the plane that the representative lines cut out (paper, III-C)."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import cv2
import numpy as np
import shapely
from numpy.typing import NDArray

from rose2_logs.model.occupancy import FloatArray

SNAP_M = 1e-3
"""Numerical: vertices are snapped to a lattice of 1 mm, far below a cell and far above rounding errors."""
SUBCELL_BITS = 8
"""Polygons are rasterized with vertices in 1/256 of a cell, the finest that OpenCV needs here."""


@dataclass(frozen=True, eq=False)
class FaceGraph:
    """A planar graph. Meters, grid frame.

    Attributes
    ----------
    polygons : (F,) array of shapely Polygon
    edges_m : (E, 4) float
        Edges x0, y0, x1, y1.
    edge_faces : (E, 2) int32
        The faces at both sides, -1 for the outside of the frame.
    """

    polygons: NDArray[np.object_]
    edges_m: FloatArray
    edge_faces: NDArray[np.int32]


def build_faces(lines_m: FloatArray, frame: shapely.Polygon) -> FaceGraph:
    """Cut a convex part of the plane by lines.

    Parameters
    ----------
    lines_m : (L, 4) float
        Lines x0, y0, x1, y1; ends that cut nothing are left out.
    frame : shapely Polygon
        The part, meters.
    """
    lines = shapely.linestrings(lines_m.reshape(-1, 2, 2))
    lines = shapely.intersection(lines, frame)
    network = shapely.union_all(np.append(lines, frame.exterior), grid_size=SNAP_M)
    polygons = shapely.get_parts(shapely.polygonize([network]))
    # A fixed order: by the lowest, then leftmost corner, whatever GEOS does inside.
    bounds = shapely.bounds(polygons)
    polygons = polygons[np.lexsort((shapely.area(polygons), bounds[:, 0], bounds[:, 1]))]
    rings, face_of_ring = shapely.get_rings(polygons, return_index=True)
    points, ring = shapely.get_coordinates(rings, return_index=True)
    inner = np.flatnonzero(ring[1:] == ring[:-1])
    # Each vertex is one number, and each pair of vertices, for NumPy is slow at finding distinct rows.
    lattice = np.rint(points / SNAP_M).astype(np.int64)
    low = lattice.min(0, initial=0)
    rows = int(lattice[:, 1].max(initial=0) - low[1]) + 1
    keys, vertex = np.unique((lattice[:, 0] - low[0]) * rows + lattice[:, 1] - low[1], return_inverse=True)
    vertices = np.column_stack(np.divmod(keys, rows)) + low
    one, other = vertex[inner], vertex[inner + 1]
    ends = np.minimum(one, other) * len(keys) + np.maximum(one, other)
    pairs, edge = np.unique(ends, return_inverse=True)
    face = face_of_ring[ring[inner]]
    order = np.lexsort((face, edge))
    edge, face = edge[order], face[order]
    second = np.zeros(len(edge), bool)
    second[1:] = edge[1:] == edge[:-1]
    edge_faces = np.full((len(pairs), 2), -1, np.int32)
    edge_faces[edge[~second], 0] = face[~second]
    edge_faces[edge[second], 1] = face[second]
    edges = np.column_stack([vertices[ends] for ends in np.divmod(pairs, len(keys))]) * SNAP_M
    return FaceGraph(polygons, edges, edge_faces)


def rasterize(
    polygons: NDArray[np.object_], values: NDArray[np.int32], shape: tuple[int, int], resolution_m: float
) -> NDArray[np.int32]:
    """Paint polygons into cells: (H, W) int32 with `values`, 0 where there is none."""
    image = np.zeros(shape, np.int32)
    scale = 1 << SUBCELL_BITS
    parts, polygon = shapely.get_parts(polygons, return_index=True)
    rings, part = shapely.get_rings(parts, return_index=True)
    points, ring = shapely.get_coordinates(rings, return_index=True)
    corners = np.rint((points / resolution_m - 0.5) * scale).astype(np.int32)
    ring_ends = np.searchsorted(ring, np.arange(len(rings)), side="right").tolist()
    outlines = [corners[begin:end] for begin, end in itertools.pairwise([0, *ring_ends])]
    part_ends = np.searchsorted(part, np.arange(len(parts)), side="right").tolist()
    begin = 0
    for value, end in zip(values[polygon].tolist(), part_ends, strict=True):
        cv2.fillPoly(image, outlines[begin:end], value, shift=SUBCELL_BITS)
        begin = end
    return image


def label_faces(graph: FaceGraph, shape: tuple[int, int], resolution_m: float) -> NDArray[np.int32]:
    """Paint the faces: (H, W) int32 with 1 + index of the face that holds each cell, 0 for none."""
    return rasterize(
        graph.polygons, np.arange(1, len(graph.polygons) + 1, dtype=np.int32), shape, resolution_m
    )
