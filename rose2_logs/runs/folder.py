"""A folder that ``analyze`` has written: its summary, its tables, and the plan of any of its maps."""

from __future__ import annotations

import dataclasses
import json
import os
from contextlib import nullcontext
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from rose2_logs.config.parameters import Parameters
from rose2_logs.errors import LogError, ParameterError
from rose2_logs.io.discovery import ANNOTATED_ENDING
from rose2_logs.model.room_plan import PlanRoom, RoomPlan
from rose2_logs.model.rooms import Doorway
from rose2_logs.runs.maps import RunMaps
from rose2_logs.runs.provenance import log_files
from rose2_logs.runs.tables import BACK_PROJECTED, SUMMARY, TABLES
from rose2_logs.system.files import require_utf8
from rose2_logs.system.text import percent

if TYPE_CHECKING:
    import pyarrow as pa

Row = dict[str, Any]


def find_results(folder: Path) -> list[Path]:
    """Find the folders with results of a log: the folder itself, or all below it, sorted.

    Raises
    ------
    LogError
        If there are none.
    """
    if (folder / SUMMARY).is_file():
        return [folder]
    if not folder.is_dir():
        raise LogError(f"{folder}: there is no such folder; give one that rose2-logs analyze has written")
    found = (path.parent for path in folder.rglob(SUMMARY))
    shown = [
        path for path in found if not any(part.startswith(".") for part in path.relative_to(folder).parts)
    ]
    if not shown:
        raise LogError(f"{folder}: holds no {SUMMARY}; give a folder that rose2-logs analyze has written")
    return sorted(shown)


class RunResults:
    """The results of one log.

    Parameters
    ----------
    folder : path
        The folder with ``summary.json``.

    Attributes
    ----------
    folder : path
    summary : dict
        The content of ``summary.json``.

    Raises
    ------
    LogError
        If the folder is not one of results, or its summary cannot be read.
    OutputError
        If its name is not UTF-8.
    """

    def __init__(self, folder: Path) -> None:
        require_utf8(folder)
        self.folder = folder
        path = folder / SUMMARY
        if not path.is_file():
            below = min((found.parent for found in folder.rglob(SUMMARY)), default=None)
            hint = f"did you mean {below}?" if below else "analyze writes such a folder for each log"
            raise LogError(f"{folder}: holds no {SUMMARY}; {hint}")
        try:
            summary = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise LogError(f"{path}: cannot be read: {error}; analyze the log again") from error
        if not isinstance(summary, dict) or not {"log", "topic", "results", "files"} <= summary.keys():
            raise LogError(f"{path}: is not the summary of a run; give a folder that analyze has written")
        self.summary: dict[str, Any] = summary

    @property
    def name(self) -> str:
        """Name of the results: that of their folder."""
        return self.folder.resolve().name

    @property
    def annotated_log(self) -> Path | None:
        """The annotated MCAP, None if the run wrote none or it is gone."""
        names = [name for name in self.summary["files"] if str(name).endswith(ANNOTATED_ENDING)]
        paths = [self.folder / Path(name).name for name in names]
        return next((path for path in paths if path.is_file()), None)

    def find_log(self) -> str:
        """Find the log of the results: where it was, or where it lay as seen from them, or as it was given.

        Raises
        ------
        LogError
            If there is none of its size.
        """
        given, place = str(self.summary["log"]), self.summary.get("log_location") or {}
        beside = place.get("from_results")
        found = [place.get("absolute"), beside and os.path.normpath(self.folder.resolve() / beside), given]
        candidates = list(dict.fromkeys(str(each) for each in found if each))
        size = self.summary.get("input", {}).get("size_bytes")
        held = {each: sum(file.stat().st_size for file in log_files(Path(each))) for each in candidates}
        of_its_size = [each for each in candidates if held[each] and held[each] == size]
        if of_its_size:
            return of_its_size[0]
        if others := [each for each in candidates if held[each]]:
            raise LogError(
                f"{others[0]} is not the log that the results are of: {held[others[0]]} bytes, not {size}"
            )
        raise LogError(f"there is no log at {' or '.join(candidates)}")

    def table(self, name: str, columns: list[str] | None = None, snapshot: int | None = None) -> pa.Table:
        """Read a table, or some of its columns, or its rows of one snapshot.

        Raises
        ------
        LogError
            If it is not there or cannot be read.
        """
        import pyarrow as pa
        import pyarrow.parquet as pq

        if name not in (*TABLES, BACK_PROJECTED):
            raise ValueError(f"no table {name!r}; there are {', '.join((*TABLES, BACK_PROJECTED))}")
        path = self.folder / f"{name}.parquet"
        rows = None if snapshot is None else [("snapshot", "=", snapshot)]
        try:
            return pq.read_table(path, columns=columns, filters=rows, partitioning=None)
        except (OSError, pa.ArrowException) as error:
            raise LogError(f"{path}: cannot be read: {error}; analyze the log again") from error

    def back_projected(self) -> pa.Table | None:
        """Read how much of the last map's rooms each map shows; None if the run was not back_projected.

        Raises
        ------
        LogError
            If the table cannot be read.
        """
        name = f"{BACK_PROJECTED}.parquet"
        # One that the summary does not name is of an earlier run.
        is_there = name in self.summary["files"] and (self.folder / name).is_file()
        return self.table(BACK_PROJECTED) if is_there else None

    @cached_property
    def snapshots(self) -> dict[str, np.ndarray[Any, Any]]:
        """Columns of the table of snapshots; null is NaN."""
        table = self.table("snapshots")
        return {name: table[name].to_numpy(zero_copy_only=False) for name in table.column_names}

    def choose(self, snapshot: int | None = None, coverage: float | None = None) -> int:
        """Return the number of a snapshot: that one, or the first that covers so much, or the last.

        Raises
        ------
        ParameterError
            If there is no such snapshot, or the coverage is no share.
        """
        numbers = self.snapshots["snapshot"]
        if snapshot is not None:
            if snapshot not in numbers:
                raise ParameterError(
                    f"{self.folder}: no snapshot {snapshot}; they go from {numbers[0]} to {numbers[-1]}"
                )
            return snapshot
        if coverage is None:
            return int(numbers[-1])
        if not 0 <= coverage <= 1:
            raise ParameterError(f"the coverage is a share from 0 to 1, not {coverage:g}; half is 0.5")
        covered = np.flatnonzero(self.snapshots["coverage"] >= coverage)
        return int(numbers[covered[0]] if len(covered) else numbers[-1])

    def row(self, snapshot: int) -> Row:
        """Return what the table of snapshots tells of one."""
        (place,) = np.flatnonzero(self.snapshots["snapshot"] == snapshot)
        return {name: values[place] for name, values in self.snapshots.items()}

    def open_maps(self) -> RunMaps | nullcontext[None]:
        """Open the maps of the run, as far as the annotated MCAP is there; a context manager."""
        path = self.annotated_log
        if path is None:
            return nullcontext()
        used = self.parameters("reading", "occupancy")
        return RunMaps(path, str(self.summary["topic"]), used.reading, used.occupancy)

    def parameters(self, *blocks: str) -> Parameters:
        """Return those of some blocks that the run had; of another version's results as far as known."""
        used, defaults = self.summary.get("parameters", {}), Parameters()
        try:
            wanted = {block: self._known(used.get(block, {}), getattr(defaults, block)) for block in blocks}
            return defaults.replaced(wanted)
        except (ParameterError, AttributeError):
            return defaults

    @staticmethod
    def _known(used: dict[str, Any], block: Any) -> dict[str, Any]:
        names = {each.name for each in dataclasses.fields(block)}
        return {name: value for name, value in used.items() if name in names}

    def plan(self, snapshot: int, maps: RunMaps | None, *, with_walls: bool = False) -> RoomPlan:
        """Return the floor plan of a snapshot, whose rooms go by their tracks.

        Parameters
        ----------
        snapshot : int
            Its number.
        maps : RunMaps or None
            What `open_maps` gave; without it the plan has no map and no walls.
        with_walls : bool
            Whether to read the wall segments too.

        Raises
        ------
        LogError
            If a file cannot be read.
        """
        row = self.row(snapshot)
        rooms = tuple(_room(each) for each in self.table("rooms", snapshot=snapshot).to_pylist())
        doorways = tuple(_doorway(each) for each in self.table("doorways", snapshot=snapshot).to_pylist())
        time_ns = int(row["log_time_ns"])
        return RoomPlan(
            f"{self.name}, snapshot {snapshot}, coverage {percent(float(row['coverage']))}",
            str(row["frame_id"]),
            tuple(sorted(rooms, key=lambda room: room.number)),
            doorways,
            maps.walls_m(time_ns) if maps is not None and with_walls else None,
            None if maps is None else maps.read(time_ns, rooms),
        )


def _room(row: Row) -> PlanRoom:
    point = (row["label_x_m"], row["label_y_m"])
    return PlanRoom(
        row["track"],
        shapely.from_wkb(row["polygon_wkb"]),
        row["area_m2"],
        None if point[0] is None else point,
        tuple(row["neighbors"]),
        row["wall_support"],
        row["frontier_m"],
    )


def _doorway(row: Row) -> Doorway:
    ends = np.array([[row["x0_m"], row["y0_m"]], [row["x1_m"], row["y1_m"]]])
    return Doorway((row["track_a"], row["track_b"]), ends)
