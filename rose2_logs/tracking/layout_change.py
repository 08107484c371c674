"""How much the layout changed from one map to the next, and how far the map moved over the run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from rose2_logs.model.occupancy import FloatArray
from rose2_logs.model.rooms import RoomMap
from rose2_logs.tracking.matching import RegionShape
from rose2_logs.tracking.registration import RigidMotion

NOTHING: Mapping[RegionShape, FloatArray] = MappingProxyType({})


@dataclass(frozen=True)
class LayoutChange:
    """What changed since the map before, over the floor that is in a room in both.

    Attributes
    ----------
    variation_bits : float or None
        Variation of information between the two divisions of this floor into rooms (Meila, 2007), in bits:
        0 where they are the same, whatever the rooms' numbers. None without such floor.
    changed_share : float or None
        Share of this floor that is in a room of another track than before.
    drift : RigidMotion
        All motions of the map since the run's first one, as one.
    """

    variation_bits: float | None
    changed_share: float | None
    drift: RigidMotion


class LayoutFollower:
    """Compares each map's rooms with those of the map before; remembers these, packed."""

    def __init__(self) -> None:
        self._tracks: tuple[int, ...] = ()
        self._shapes: tuple[RegionShape | None, ...] = ()
        self._drift = RigidMotion.none()

    def update(
        self,
        rooms: RoomMap,
        shapes: tuple[RegionShape | None, ...],
        track_ids: Sequence[int],
        motion: RigidMotion | None,
        known: Mapping[RegionShape, FloatArray] = NOTHING,
    ) -> LayoutChange:
        """Take the next map of the run.

        Parameters
        ----------
        rooms : RoomMap
            Its rooms.
        shapes : tuple of R RegionShape or None
            The same, cut out.
        track_ids : sequence of R int
            Their tracks.
        motion : RigidMotion, optional
            How the map moved since the one before.
        known : mapping of RegionShape to (R,) float, optional
            What some shapes have in common with its rooms.
        """
        common = np.zeros((len(self._shapes), len(rooms)))
        for row, shape in enumerate(self._shapes):
            if shape is not None:
                there = shape if motion is None else shape.moved(motion)
                shared = known.get(there)
                if shared is None:
                    shared = there.common_area_m2(rooms.labels, rooms.geometry, len(rooms))
                common[row] = shared
        same = np.array(self._tracks, np.int64)[:, None] == np.array(track_ids, np.int64)
        self._tracks = tuple(track_ids)
        self._shapes = shapes
        self._drift = self._drift if motion is None else self._drift.then(motion)
        floor = float(common.sum())
        if floor == 0:
            return LayoutChange(None, None, self._drift)
        changed = 1 - float(common[same].sum()) / floor
        return LayoutChange(variation_of_information(common), max(changed, 0.0), self._drift)


def variation_of_information(common: FloatArray) -> float:
    """Information that two divisions of the same ground do not share, in bits.

    Parameters
    ----------
    common : (A, B) float
        Size of the intersection of each part of one with each part of the other; not all zero.
    """
    share = common / common.sum()
    of_first = np.broadcast_to(share.sum(axis=1, keepdims=True), share.shape)[share > 0]
    of_second = np.broadcast_to(share.sum(axis=0), share.shape)[share > 0]
    share = share[share > 0]
    # Adding nothing turns a negative zero into zero.
    return max(-float((share * np.log2(share**2 / (of_first * of_second))).sum()), 0.0) + 0.0
