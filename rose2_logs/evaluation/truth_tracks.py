"""True rooms of single maps, linked over a run by their overlap."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rose2_logs.occupancy import GridGeometry
from rose2_logs.tracking.alignment import RigidMotion
from rose2_logs.tracking.matching import RegionShape, assign, cut_out_rooms

SAME_MIN_SHARE = 0.5
"""A true room is an earlier one when one of the two holds most of the other: rooms grow as they are seen."""


class TruthLinker:
    """Numbers true rooms over a run.

    The rooms of each map and the last shapes of all true rooms so far, also of those that later maps do not
    show, are paired by the greatest sum of intersection over union, as far as one of the two holds at least
    `SAME_MIN_SHARE` of the other; what is left gets a new number.
    """

    def __init__(self) -> None:
        self._last: dict[int, RegionShape] = {}

    def update(
        self, labels: NDArray[np.int32], geometry: GridGeometry, motion: RigidMotion | None
    ) -> NDArray[np.int32]:
        """Take the true rooms of the next map.

        Parameters
        ----------
        labels : (H, W) int32
            True rooms, 0 = none, row 0 at the grid's origin.
        geometry : GridGeometry
            Where the map lies.
        motion : RigidMotion, optional
            How the map moved since the one before.

        Returns
        -------
        (L + 1,) int32
            Number of each label up to the greatest, L; 0 for a label that does not occur.
        """
        if motion is not None:
            self._last = {number: shape.moved(motion) for number, shape in self._last.items()}
        shapes = cut_out_rooms(labels, geometry, int(labels.max(initial=0)))
        areas = np.array([0.0 if shape is None else shape.area_m2 for shape in shapes])
        before = np.array([shape.area_m2 for shape in self._last.values()])[:, None]
        common = np.zeros((len(before), len(areas)))
        for row, last in enumerate(self._last.values()):
            common[row] = last.common_area_m2(labels, geometry, len(areas))
        same = (common > 0) & (common >= SAME_MIN_SHARE * np.minimum(before, areas))
        numbers = np.zeros(len(areas) + 1, np.int32)
        known = list(self._last)
        for row, column in assign(common / np.maximum(before + areas - common, common), same):
            numbers[column + 1] = known[row]
        for label, shape in enumerate(shapes, start=1):
            if shape is not None:
                numbers[label] = numbers[label] or len(self._last) + 1
                self._last[int(numbers[label])] = shape
        return numbers
