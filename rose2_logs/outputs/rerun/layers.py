"""Layers of a recording: on every timeline, only where they change, many snapshots to a chunk.

A chunk of a recording costs some kilobytes in the file, and in memory until the file is closed, as Rerun
lists all chunks at the file's end. So rows wait until those of an entity are worth a chunk.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np
import rerun as rr

from rose2_logs.outputs.rerun.columns import Entry, Label, LayerKind, Picture, Scalar, Strips, columns_of

CHUNK_BYTES = 1 << 20
"""Rows of an entity are written together from this size on; as Rerun's own batcher does."""
ROW_BYTES = 1 << 10
"""What a row counts for besides its arrays: several times what it takes, so that a thousand wait at most."""
ROUNDING_DIGITS = 9
"""Numerical: 100 times 0.29 is 28.999999999999996; no map has so many cells that one of them counts less."""
WAITING_BYTES = 1 << 24
"""Rows of all entities that wait at most: some large pictures, or outlines of a large building's rooms."""


class Instant(NamedTuple):
    """Position of a snapshot on each timeline: nanoseconds, its number, whole percent."""

    message_log_time: int
    ros2_timestamp: int
    snapshot: int
    coverage_percent: int


def whole_percent(coverage: float) -> int:
    """Return the place of a coverage on its timeline: rounded down, so that only the whole is 100."""
    return math.floor(round(100 * coverage, ROUNDING_DIGITS))


@dataclass
class _Entity:
    """What an entity shows, and the rows that wait."""

    shown: LayerKind
    instants: list[Instant] = field(default_factory=list)
    rows: list[LayerKind] = field(default_factory=list)
    nbytes: int = 0


class Layers:
    """Writes layers to a recording, each only where it differs from what its entity shows already.

    At any place of a timeline a viewer shows what was logged last before it on that timeline, so that what
    has not changed can be left out as long as the timelines go forward. So they do: a snapshot that covers
    less than one before it, or has an earlier stamp, stands at the greatest coverage or the latest stamp so
    far, behind the other.

    Parameters
    ----------
    recording : RecordingStream
        Where to log.
    chunk_bytes : int
        Rows of an entity wait until they have this size; with 0 they do not wait.
    waiting_bytes : int
        When all that wait have this size, those of the entity that has most are written.
    """

    def __init__(
        self,
        recording: rr.RecordingStream,
        chunk_bytes: int = CHUNK_BYTES,
        waiting_bytes: int = WAITING_BYTES,
    ) -> None:
        self._recording = recording
        self._chunk_bytes = chunk_bytes
        self._waiting_bytes = waiting_bytes
        self._nbytes = 0
        self._entities: dict[str, _Entity] = {}
        self._now: Instant | None = None

    def begin(self, log_time_ns: int, stamp_ns: int, snapshot: int, coverage_percent: int) -> None:
        """Start a snapshot: everything is logged at these times from now on."""
        before = self._now
        if before is not None:
            stamp_ns = max(stamp_ns, before.ros2_timestamp)
            coverage_percent = max(coverage_percent, before.coverage_percent)
        self._now = Instant(log_time_ns, stamp_ns, snapshot, coverage_percent)

    @property
    def now(self) -> Instant:
        """Position of the present snapshot on each timeline."""
        return Instant(0, 0, 0, 0) if self._now is None else self._now

    def show(self, path: str, layer: LayerKind) -> None:
        """Let an entity show a layer from the present snapshot on; the layers of one are all of one kind."""
        entity = self._entities.get(path)
        if entity is None or not _equal(layer, entity.shown):
            self.add(path, layer)

    def add(self, path: str, layer: LayerKind) -> None:
        """Log a layer also where it is the same as before: the point of a curve, an entry of a list."""
        entity = self._entities.setdefault(path, _Entity(layer))
        entity.shown = layer
        entity.instants.append(self.now)
        entity.rows.append(layer)
        nbytes = ROW_BYTES + sum(value.nbytes for value in _values(layer) if isinstance(value, np.ndarray))
        entity.nbytes += nbytes
        self._nbytes += nbytes
        if entity.nbytes >= self._chunk_bytes:
            self._write(path, entity)
        elif self._nbytes >= self._waiting_bytes:
            self._write(*max(self._entities.items(), key=lambda item: item[1].nbytes))

    def clear(self, path: str) -> None:
        """Show nothing at and below a path from the present snapshot on."""
        for known in [each for each in self._entities if each == path or each.startswith(f"{path}/")]:
            # Of what stands at one place of a timeline, a viewer takes what was written last.
            self._write(known, self._entities.pop(known))
        now = self.now
        self._recording.set_time("message_log_time", timestamp=np.datetime64(now.message_log_time, "ns"))
        self._recording.set_time("ros2_timestamp", timestamp=np.datetime64(now.ros2_timestamp, "ns"))
        self._recording.set_time("snapshot", sequence=now.snapshot)
        self._recording.set_time("coverage_percent", sequence=now.coverage_percent)
        self._recording.log(path, rr.Clear(recursive=True))

    def count_below(self, path: str) -> int:
        """Return how many entities under a path show something."""
        return sum(each.startswith(f"{path}/") for each in self._entities)

    def flush(self) -> None:
        """Write all rows that wait."""
        for path, entity in self._entities.items():
            self._write(path, entity)

    def _write(self, path: str, entity: _Entity) -> None:
        if not entity.rows:
            return
        self._recording.send_columns(path, time_columns(entity.instants), columns_of(entity.rows))
        self._nbytes -= entity.nbytes
        entity.instants, entity.rows, entity.nbytes = [], [], 0


def time_columns(instants: Sequence[Instant]) -> list[rr.TimeColumn]:
    """Times of some rows on every timeline; at least one."""
    columns = {
        name: np.array(times)
        for name, times in zip(Instant._fields, zip(*instants, strict=True), strict=True)
    }
    times = [
        rr.TimeColumn(name, timestamp=columns[name].astype("datetime64[ns]"))
        for name in ("message_log_time", "ros2_timestamp")
    ]
    return times + [rr.TimeColumn(name, sequence=columns[name]) for name in ("snapshot", "coverage_percent")]


# Computed once: what `dataclasses.fields` would return for each layer.
_VALUES = {
    Strips: attrgetter("points_m", "lengths", "colors"),
    Picture: attrgetter("pixels", "cell_m", "corner_m", "yaw_rad", "colormap"),
    Label: attrgetter("point_m", "text"),
    Scalar: attrgetter("value"),
    Entry: attrgetter("text", "level"),
}


def _values(layer: LayerKind) -> tuple[Any, ...]:
    found = _VALUES[type(layer)](layer)
    return found if isinstance(found, tuple) else (found,)


def _equal(one: LayerKind, other: LayerKind) -> bool:
    """Whether two layers of a kind show the same."""
    return all(
        np.array_equal(mine, its) if isinstance(mine, np.ndarray) else mine == its
        for mine, its in zip(_values(one), _values(other), strict=True)
    )
