"""Log to stream of occupancy snapshots; nothing outside this package knows a file format."""

from rose2_logs.readers.log import Selection
from rose2_logs.readers.opening import inspect_log, open_log

__all__ = ["Selection", "inspect_log", "open_log"]
