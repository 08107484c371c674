"""What is found for shapes, kept for those that the next map has, too: many do not change from map to map."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Generic, TypeVar

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

Found = TypeVar("Found")


class PerShape(Generic[Found]):
    """Asks a function about shapes, and again only about those that were not among the ones before.

    Parameters
    ----------
    function : callable
        Returns something for each of some shapes, which does not depend on the others.
    """

    def __init__(self, function: Callable[[NDArray[np.object_]], Sequence[Found]]) -> None:
        self._function = function
        self._known: dict[bytes, Found] = {}

    def __call__(self, shapes: Sequence[BaseGeometry] | NDArray[np.object_]) -> list[Found]:
        """Return what the function says of each shape."""
        of_map = np.array(shapes, object)
        keys: list[bytes] = shapely.to_wkb(of_map).tolist()
        known = self._known
        new = {key: number for number, key in enumerate(keys) if key not in known}
        found = known | dict(zip(new, self._function(of_map[list(new.values())]), strict=True))
        self._known = {key: found[key] for key in keys}
        return [found[key] for key in keys]
