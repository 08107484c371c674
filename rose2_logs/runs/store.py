"""A run as stored data: its tables, walls, maps and label images, written as it goes on."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from rose2_logs.config.kinds import KindParameters
from rose2_logs.config.parameters import OccupancyParameters
from rose2_logs.model.per_shape import PerShape
from rose2_logs.model.room_kinds import guess_kinds
from rose2_logs.runs import tables
from rose2_logs.runs.history import RunHistory, RunSummary
from rose2_logs.runs.parquet_table import ParquetTable, Row
from rose2_logs.runs.tables import BACK_PROJECTED, TABLES, snapshot_key
from rose2_logs.system.files import writing
from rose2_logs.tracking.back_projection import BackProjectedSnapshot
from rose2_logs.tracking.convergence import RoomRows
from rose2_logs.tracking.tracked_snapshot import TrackedSnapshot

ROWS_AT_ONCE = 2000
"""Rows that are read back together, by one thread, as each thread keeps some megabytes."""
ALONG = "snapshots_along"
"""Snapshots as far as they are known along the run; they get two columns more in the end, written anew."""


def table_path(folder: Path, name: str) -> Path:
    """Return where a table of a run lies."""
    return folder / f"{name}.parquet"


class RunStore:
    """Writes a run to a folder: the tables `TABLES`, each ``.parquet``.

    The tables hold nothing but what the log and the parameters determine: the same run gives the same bytes.
    What only the whole run shows is added by `finish`, which reads some tables again from the disk. A
    context manager: leaving it without `finish` removes what was written.

    Parameters
    ----------
    folder : path
        Output folder, created if needed.
    parameters : OccupancyParameters
        Which cells are free and which occupied.
    kinds : KindParameters, optional
        For the guess of kinds of rooms.
    back_project : bool
        Whether to write the table of the back-projected rooms, too.
    """

    def __init__(
        self,
        folder: Path,
        parameters: OccupancyParameters,
        kinds: KindParameters | None = None,
        *,
        back_project: bool = False,
    ) -> None:
        self._folder = folder
        self._parameters = parameters
        self._kinds = kinds or KindParameters()
        self._kinds_of_rooms = PerShape(partial(guess_kinds, parameters=self._kinds))
        self._names = (*TABLES, BACK_PROJECTED) if back_project else TABLES
        self._stack = ExitStack()
        self._tables: dict[str, ParquetTable] = {}

    def __enter__(self) -> Self:
        from rose2_logs.runs.table_schemas import SCHEMAS

        with ExitStack() as opening:
            for name in (ALONG, *self._names):
                path = table_path(self._folder, name)
                self._tables[name] = opening.enter_context(ParquetTable(path, SCHEMAS[name]))
            self._stack = opening.pop_all()
        return self

    def write(self, step: TrackedSnapshot, history: RunHistory) -> None:
        """Take a map that the history has taken.

        Raises
        ------
        OutputError
            If a file cannot be written.
        """
        key = snapshot_key(step)
        rows: dict[str, list[Row]] = {
            ALONG: [tables.snapshot_row(step, history.snapshot_refs[step.snapshot.index])],
            "rooms": tables.room_rows(step, self._kinds_of_rooms),
            "events": tables.event_rows(step),
            "doorways": tables.doorway_rows(step),
            "borders": tables.border_rows(step),
            "maps": [tables.map_row(step, self._parameters)],
        }
        for name, of_table in rows.items():
            self._tables[name].add([key | row for row in of_table])
        if (walls := step.analysis.walls) is not None:
            columns = {"walls": tables.wall_columns(walls), "lines": tables.line_columns(walls)}
            for name, of_walls in columns.items():
                count = len(of_walls["direction"])
                of_map = {each: np.full(count, value) for each, value in key.items()}
                self._tables[name].add_columns(of_map | of_walls)

    def write_back_projected(self, found: BackProjectedSnapshot) -> None:
        """Take what a map shows of the last map's rooms.

        Raises
        ------
        OutputError
            If the file cannot be written.
        """
        key = snapshot_key(found)
        self._tables[BACK_PROJECTED].add([key | row for row in tables.back_projected_rows(found)])

    def finish(self, history: RunHistory, threads: int = 1) -> RunSummary:
        """Add what the last map says about earlier ones, and give the tables their names.

        Parameters
        ----------
        history : RunHistory
            That has taken all maps.
        threads : int
            How many compare earlier maps with the last one.

        Returns
        -------
        RunSummary
            What the run came to.

        Raises
        ------
        OutputError
            If a file cannot be written or read back.
        """
        for table in self._tables.values():
            if table is not self._tables["snapshots"] and table is not self._tables["tracks"]:
                table.close()
        summary = history.summary(self._rooms(), threads)
        convergence = summary.convergence
        for row in self._along():
            index = row["snapshot"]
            final = {
                "final_iou": convergence.final_iou[index],
                "final_share": convergence.final_share[index],
                "known_final_share": convergence.known_final_share[index],
            }
            self._tables["snapshots"].add([row | final])
        for part, of_part in summary.parts.items() or [(tables.ONLY_PART, summary)]:
            for track, of_track in sorted(of_part.histories.tracks.items()):
                in_last_map = track in of_part.histories.in_last_map
                row = tables.track_row(
                    track, of_track, of_part.convergence, self._kinds, in_last_map=in_last_map
                )
                self._tables["tracks"].add([row | {"part": part}])
        for name in ("snapshots", "tracks"):
            self._tables[name].close()
        for name in self._names:
            self._tables[name].publish()
        return summary

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._stack.close()

    def _along(self) -> Iterator[Row]:
        import pyarrow.parquet as pq

        path = self._tables[ALONG].part
        with writing(path), pq.ParquetFile(path) as file:
            for batch in file.iter_batches(ROWS_AT_ONCE, use_threads=False):
                yield from batch.to_pylist()

    def _rooms(self) -> Iterator[RoomRows]:
        import pyarrow.parquet as pq
        import shapely

        columns = ["snapshot", "track", "area_m2", "polygon_wkb"]
        path = self._tables["rooms"].part
        with writing(path), pq.ParquetFile(path) as file:
            for batch in file.iter_batches(ROWS_AT_ONCE, columns=columns, use_threads=False):
                snapshot, track, area_m2, polygons = (
                    batch[name].to_numpy(zero_copy_only=False) for name in columns
                )
                yield RoomRows(snapshot, track, area_m2, np.asarray(shapely.from_wkb(polygons), object))
