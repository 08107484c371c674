"""What stage C returns: faces, edge weights, and the rooms that the faces make up."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from shapely.geometry import Polygon

from rose2_logs.occupancy import FloatArray


@dataclass(frozen=True, eq=False)
class FloorPlan:
    """The plane cut into faces by the representative lines (paper, section III-C). World metres.

    Attributes
    ----------
    edges_m : (E, 4) float
        Edges x0, y0, x1, y1.
    edge_weight : (E,) float
        Share of each edge that walls cover, in [0, 1].
    edge_faces : (E, 2) int
        The faces at both sides of each edge; -1 where there is none.
    faces : tuple of F shapely Polygon
        The faces.
    face_inside : (F,) bool
        Faces that belong to the building as far as it was seen.
    room_of_face : (F,) int
        Room number 1..R of each face, 0 for none.
    """

    edges_m: FloatArray
    edge_weight: FloatArray
    edge_faces: NDArray[np.int32]
    faces: tuple[Polygon, ...]
    face_inside: NDArray[np.bool_]
    room_of_face: NDArray[np.int32]
