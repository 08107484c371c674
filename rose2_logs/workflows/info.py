"""What ``info`` shows of a log: its topics, and the first and the last map of each map topic."""

from __future__ import annotations

import dataclasses
from contextlib import closing
from dataclasses import dataclass
from typing import Any

from rose2_logs.config.parameters import OccupancyParameters, Parameters
from rose2_logs.config.selection import Selection
from rose2_logs.errors import LogError
from rose2_logs.io import LogReader, open_source
from rose2_logs.io.scan_topics import mappable_topics
from rose2_logs.io.source import LogInfo, MessageSource
from rose2_logs.model.occupancy import OccupancySnapshot, classify


@dataclass(frozen=True)
class MapFacts:
    """One map of a topic.

    Attributes
    ----------
    log_time_ns : int
        When it was recorded.
    shape : (int, int)
        Rows and columns.
    resolution_m : float
        Side of a cell.
    frame_id : str
        World frame.
    free_area_m2 : float
        Known free area.
    """

    log_time_ns: int
    shape: tuple[int, int]
    resolution_m: float
    frame_id: str
    free_area_m2: float


@dataclass(frozen=True)
class TopicFacts:
    """A map topic: its first and last map, or why there are none."""

    topic: str
    first: MapFacts | None
    last: MapFacts | None
    trouble: str | None = None

    @property
    def coverage_first(self) -> float | None:
        """Known free area of the first map over that of the last, at most 1: where the coverage starts."""
        if self.first is None or self.last is None or self.last.free_area_m2 <= 0:
            return None
        return min(self.first.free_area_m2 / self.last.free_area_m2, 1.0)


@dataclass(frozen=True)
class LogFacts:
    """A log, its map topics, and the topics of laser scans from which maps can be built."""

    info: LogInfo
    maps: tuple[TopicFacts, ...]

    @property
    def map_from(self) -> tuple[str, ...]:
        """Topics with laser scans whose place is known."""
        return mappable_topics(self.info)

    def as_json(self) -> dict[str, Any]:
        """Return everything as JSON values."""
        info = dataclasses.asdict(self.info) | {
            "path": str(self.info.path),
            "duration_s": self.info.duration_s,
        }
        maps = [dataclasses.asdict(facts) | {"coverage_first": facts.coverage_first} for facts in self.maps]
        return info | {"maps": maps, "map_from": list(self.map_from)}


def describe_log(log: str, parameters: Parameters | None = None) -> LogFacts:
    """Look at a log without reading all of it.

    Parameters
    ----------
    log : str
        Its path.
    parameters : Parameters, optional
        What may be read at most, and which cells are free.

    Raises
    ------
    LogError
        If the log cannot be opened. A map topic that cannot be read is listed with the reason instead.
    """
    # Opened once: the index of a large log is megabytes.
    used = parameters or Parameters()
    with closing(open_source(log, used.reading, used.occupancy)) as source:
        topics = [topic for topic in source.info.topics if topic.is_map and topic.message_count != 0]
        return LogFacts(source.info, tuple(_topic_facts(source, topic.name, used) for topic in topics))


def _topic_facts(source: MessageSource, topic: str, parameters: Parameters) -> TopicFacts:
    try:
        reader = LogReader(source, topic, Selection(), parameters)
        first, last = (_map_facts(each, parameters.occupancy) for each in (reader.first(), reader.last()))
        return TopicFacts(topic, first, last)
    except LogError as error:
        return TopicFacts(topic, None, None, str(error))


def _map_facts(snapshot: OccupancySnapshot, parameters: OccupancyParameters) -> MapFacts:
    free, _ = classify(snapshot.cells, parameters)
    geometry = snapshot.geometry
    free_m2 = float(free.sum()) * geometry.cell_area_m2
    return MapFacts(snapshot.log_time_ns, geometry.shape, geometry.resolution_m, geometry.frame_id, free_m2)
