"""What a track's room looked like: a few shapes, so that a split that is taken back is recognized."""

from __future__ import annotations

from rose2_logs.model.occupancy import FloatArray
from rose2_logs.tracking.matching import RegionShape
from rose2_logs.tracking.registration import RigidMotion


class TrackMemory:
    """The shapes that a track's room had, the newest last.

    A room that flickers between two rooms and one has the whole and the part in memory, and is recognized in
    either. A shape like one in memory takes its place; where there are too many, the one that was seen least
    often goes, the older of two alike.

    Parameters
    ----------
    shape : RegionShape
        The first.
    """

    def __init__(self, shape: RegionShape) -> None:
        self._shapes = [shape]
        self._times_seen = [1]

    @property
    def shapes(self) -> tuple[RegionShape, ...]:
        """The shapes, the newest last."""
        return tuple(self._shapes)

    def move(self, motion: RigidMotion) -> None:
        """Take part in a motion of the whole map."""
        self._shapes = [shape.moved(motion) for shape in self._shapes]

    def take(self, shape: RegionShape, iou: FloatArray, same_min_iou: float, most: int) -> None:
        """Take the room's newest shape.

        Parameters
        ----------
        shape : RegionShape
            As the next map shows it.
        iou : (S,) float
            Its intersection over union with the shapes in memory.
        same_min_iou : float
            From here on it replaces one in memory.
        most : int
            Shapes to keep.
        """
        seen, like = 1, int(iou.argmax())
        if iou[like] >= same_min_iou:
            del self._shapes[like]
            seen += self._times_seen.pop(like)
        while len(self._shapes) >= max(most, 1):
            least = min(range(len(self._shapes)), key=self._times_seen.__getitem__)
            del self._shapes[least], self._times_seen[least]
        self._shapes.append(shape)
        self._times_seen.append(seen)
