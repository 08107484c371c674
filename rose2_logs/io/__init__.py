"""Readers: from a log to its occupancy snapshots. Nothing outside this package knows a file format."""

from rose2_logs.config.selection import Selection
from rose2_logs.io.log import LogReader
from rose2_logs.io.opening import inspect_log, map_topics, open_log, open_source

__all__ = ["LogReader", "Selection", "inspect_log", "map_topics", "open_log", "open_source"]
