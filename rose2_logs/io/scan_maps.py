"""Maps built from laser scans, as if the log had recorded them."""

from __future__ import annotations

import dataclasses
import logging
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from typing import IO

import numpy as np
import zstandard

from rose2_logs.config.mapping import MappingParameters
from rose2_logs.config.selection import Selection, Times
from rose2_logs.errors import InvalidMapError, LogError
from rose2_logs.io.grids import GRID_TYPE, Grid
from rose2_logs.io.placed_scans import PlacedScans
from rose2_logs.io.source import LoggedBytes, LoggedMap, MessageSource, TopicInfo
from rose2_logs.mapping.log_odds import MapBuilder
from rose2_logs.mapping.motion_filter import MotionFilter
from rose2_logs.model.occupancy import GridGeometry
from rose2_logs.system.warnings import log_warning

logger = logging.getLogger(__name__)

BUILT = "built from scans"
"""What stands in the place of the encoding of a topic whose maps are built."""


@dataclass(frozen=True)
class _Built:
    """Where a built map is kept, when it was complete, and where it lies."""

    log_time_ns: int
    stamp_ns: int
    geometry: GridGeometry
    begin: int
    end: int


class ScanMaps(MessageSource):
    """A log with one more topic: the map as it grows with the scans.

    The maps are built in one go when the first one is asked for, and kept compressed in a temporary file, so
    that any of them can be read again and memory holds one map only.

    Parameters
    ----------
    recorded : MessageSource
        The log that the scans come from; it is closed with this one.
    scans : PlacedScans
        The scans in the world.
    parameters : MappingParameters
        How maps are built.
    selection : Selection
        Scans outside its time range are not used; maps are `every_s` apart, by default
        ``mapping.map_every_s``, and the last one is that of the last scan.
    most_cells : int
        Number of cells of the largest map.

    Attributes
    ----------
    topic : str
        Topic of the maps: that of the scans followed by ``/map``.
    """

    def __init__(
        self,
        recorded: MessageSource,
        scans: PlacedScans,
        parameters: MappingParameters,
        selection: Selection,
        most_cells: int,
    ) -> None:
        self.topic = f"{scans.topic}/map"
        built = TopicInfo(self.topic, GRID_TYPE, None, True, BUILT)
        info = recorded.info
        self.info = dataclasses.replace(
            info, topics=tuple(sorted((*info.topics, built), key=lambda each: each.name))
        )
        self._scans = scans
        self._parameters = parameters
        self._selection = selection.since(info.start_ns)
        self._most_cells = most_cells
        self._recorded = recorded
        self._opened = ExitStack()
        self._opened.callback(recorded.close)
        self._file: IO[bytes] | None = None
        self._maps: list[_Built] | None = None

    @property
    def recorded(self) -> MessageSource:
        """The log itself, without the maps."""
        return self._recorded

    def made_from(self, topic: str) -> str:
        """Topic that the messages of `topic` are made from: that of the scans for the maps."""
        return self._scans.topic if topic == self.topic else topic

    def log_times(self, topic: str) -> Times:
        """Log times of the maps, nanoseconds, sorted; those of another topic from the log.

        Raises
        ------
        LogError
            If no map can be built.
        """
        if topic != self.topic:
            return self._recorded.log_times(topic)
        return np.array([each.log_time_ns for each in self._built()], np.int64)

    def read(self, topics: Sequence[str], times: Times) -> Iterator[LoggedMap]:
        """Yield the maps at `times` (sorted, distinct), in log time order."""
        if self.topic not in topics:
            yield from self._recorded.read(topics, times)
            return
        wanted = set(times.tolist())
        for number, each in enumerate(self._built(), start=1):
            if each.log_time_ns in wanted:
                decode = partial(self._grid, each)
                yield LoggedMap(each.log_time_ns, self.topic, number, self.info.path, decode)

    def stream(self, topics: Sequence[str]) -> Iterator[LoggedBytes]:
        """Yield all messages of topics of the log, one at a time, roughly in log time order."""
        return self._recorded.stream(topics)

    def close(self) -> None:
        """Release the log's files and the kept maps; may be called more than once."""
        self._opened.close()

    def _built(self) -> list[_Built]:
        if self._maps is None:
            file = tempfile.TemporaryFile(prefix="rose2_logs_")  # noqa: SIM115 (closed with the log)
            self._file = self._opened.enter_context(file)
            self._maps = list(self._build(self._file))
            logger.info("%s: %d maps built on %s", self.info.path, len(self._maps), self.topic)
        return self._maps

    def _build(self, file: IO[bytes]) -> Iterator[_Built]:
        """Build all maps; each is kept back until the next is due, so that the last one has all scans."""
        builder, moved = MapBuilder(self._parameters, self._most_cells), MotionFilter(self._parameters)
        every_ns = round((self._selection.every_s or self._parameters.map_every_s) * 1e9)
        start_ns, end_ns = self._selection.start_ns, self._selection.end_ns
        path, frame_id = self.info.path, self._scans.frame_id
        due_ns: int | None = None
        pending: _Built | None = None
        log_time_ns = stamp_ns = 0
        refused = used = 0
        for scan in self._scans:
            if start_ns is not None and scan.log_time_ns < start_ns:
                continue
            if end_ns is not None and scan.log_time_ns > end_ns:
                break
            try:
                if moved.takes(scan.stamp_ns, scan.pose):
                    builder.add(scan.beams)
                    used += 1
            except InvalidMapError as error:
                refused += 1
                if refused == 1:
                    text = f"{path}: a scan on {self._scans.topic} is left out: with it {error}"
                    log_warning(logger, "scan_far_away", text, file=path, topic=self._scans.topic)
                continue
            # Chunks of a log may overlap; the maps are in the order of time all the same.
            log_time_ns, stamp_ns = max(log_time_ns, scan.log_time_ns), scan.stamp_ns
            due_ns = log_time_ns + every_ns if due_ns is None else due_ns
            if log_time_ns >= due_ns:
                if pending is not None:
                    yield pending
                pending = self._kept(file, builder, log_time_ns, stamp_ns, frame_id)
                due_ns = log_time_ns + every_ns
        if not used:
            raise LogError(f"{path}: no scan on {self._scans.topic} in the time range can be used", file=path)
        yield self._kept(file, builder, log_time_ns, stamp_ns, frame_id)

    def _kept(
        self, file: IO[bytes], builder: MapBuilder, log_time_ns: int, stamp_ns: int, frame_id: str
    ) -> _Built:
        begin = file.seek(0, 2)
        file.write(zstandard.compress(builder.trinary().tobytes(), 1))
        return _Built(log_time_ns, stamp_ns, builder.geometry(frame_id), begin, file.tell())

    def _grid(self, built: _Built) -> Grid | None:
        assert self._file is not None
        self._file.seek(built.begin)
        data = zstandard.decompress(self._file.read(built.end - built.begin))
        cells = np.frombuffer(data, np.int8).reshape(built.geometry.shape)
        return Grid(built.stamp_ns, built.geometry, cells) if cells.size else None
