"""How much of each room of the last map every map of a run shows, as a table."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import Self

from rose2_logs.runs.parquet_table import ParquetTable
from rose2_logs.tracking.back_projection import BackProjectedSnapshot


class BackProjectedTable:
    """Writes ``back_projected.parquet`` in the second pass over a run.

    Leaving the context without an exception makes the table whole.

    Parameters
    ----------
    path : path
        The table.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """

    def __init__(self, path: Path) -> None:
        from rose2_logs.runs import table_schemas

        self._table = ParquetTable(path, table_schemas.BACK_PROJECTED)

    def __enter__(self) -> Self:
        self._table.__enter__()
        return self

    def write_back_projected(self, found: BackProjectedSnapshot) -> None:
        """Take one map: a row for each room that it shows some of."""
        areas_m2, last_m2 = found.rooms.areas_m2, found.last_rooms.areas_m2
        self._table.add(
            [
                {
                    "snapshot": found.snapshot.index,
                    "log_time_ns": found.snapshot.log_time_ns,
                    "track": track,
                    "area_m2": areas_m2[room],
                    "last_area_share": areas_m2[room] / last_m2[room],
                }
                for room, track in enumerate(found.track_ids)
                if areas_m2[room] > 0
            ]
        )

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        try:
            if kind is None:
                self._table.close()
                self._table.publish()
        finally:
            self._table.__exit__(kind, error, traceback)
