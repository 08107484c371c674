"""The folder of a run, read back: summary, tables, maps, walls and floor plans."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import cached_property
from numbers import Integral, Real
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from rose2_logs.config.parameters import OccupancyParameters, Parameters
from rose2_logs.errors import InvalidMapError, ParameterError, ResultsError
from rose2_logs.io.discovery import ANNOTATED_ENDING
from rose2_logs.model.analysis import Walls
from rose2_logs.model.borders import Border
from rose2_logs.model.occupancy import GridGeometry, OccupancySnapshot
from rose2_logs.model.room_names import room_name
from rose2_logs.model.room_plan import PlanMap, PlanRoom, RoomPlan
from rose2_logs.model.rooms import Doorway
from rose2_logs.runs.names import names_in, tell_unused
from rose2_logs.runs.parquet_table import Row
from rose2_logs.runs.summary import RESULTS_FORMAT, SUMMARY
from rose2_logs.runs.summary_schema import what_it_lacks
from rose2_logs.runs.tables import BACK_PROJECTED, ONLY_PART, TABLES, unpack_image
from rose2_logs.system.files import expanded, reason_of, require_utf8
from rose2_logs.system.text import counted, percent
from rose2_logs.tracking.registration import RigidMotion

if TYPE_CHECKING:
    import pyarrow as pa

MAKE_AGAIN = "analyze the log again"
"""The remedy for results that cannot be used."""


def find_results(folder: Path) -> list[Path]:
    """Find the folders with results of a log: the folder itself, or all below it, sorted.

    Raises
    ------
    ResultsError
        If there are none.
    """
    if (folder / SUMMARY).is_file():
        return [folder]
    if not folder.is_dir():
        what = "is a file, not a folder" if folder.is_file() else "there is no such folder"
        raise ResultsError(f"{folder}: {what}; give one that an analysis has written")
    found = (path.parent for path in folder.rglob(SUMMARY))
    shown = [
        path for path in found if not any(part.startswith(".") for part in path.relative_to(folder).parts)
    ]
    if not shown:
        raise ResultsError(f"{folder}: holds no {SUMMARY}; give a folder that an analysis has written")
    return sorted(shown)


class StoredRun:
    """What a run has stored, as reports, exports and comparisons need it; see `Run`.

    Parameters
    ----------
    folder : path
        The folder with ``summary.json``.
    part : int, optional
        The part to take alone, of a run in which maps were begun anew; of others, part 1 is all of it.
    """

    def __init__(self, folder: Path, part: int | None = None) -> None:
        self.folder = folder
        require_utf8(folder)
        self.summary: dict[str, Any] = _read_summary(folder)
        self.part = part if self._parts else None
        whole = self.summary["results"]
        if part is not None and (self._parts or part != ONLY_PART):
            of_part = next((each for each in self._parts if each["part"] == part), None)
            if of_part is None:
                has = ", ".join(map(str, self.parts or (ONLY_PART,)))
                raise ParameterError(f"{folder}: no part {part!r}; it has {has}")
            results = self.summary["results"] | of_part["results"]
            self.summary |= {"results": results, "layout": of_part["layout"]}
        self._require_parameters()
        for name in (*TABLES, *([BACK_PROJECTED] if self.is_back_projected else ())):
            self._schema(name)
        self._require_rows(whole)

    @property
    def parts(self) -> tuple[int, ...]:
        """Numbers of the parts of a log in which maps were begun anew; none for other logs."""
        return tuple(each["part"] for each in self._parts)

    @property
    def _parts(self) -> list[dict[str, Any]]:
        parts: list[dict[str, Any]] = self.summary.get("parts", [])
        return parts

    @property
    def name(self) -> str:
        """Name of the run: that of its folder."""
        return self.folder.resolve().name

    @cached_property
    def parameters(self) -> Parameters:
        """The parameters that the run had."""
        return Parameters().replaced(self.summary["parameters"])

    def _require_parameters(self) -> None:
        """Refuse parameters that are not those of this version."""
        path, kept = self.folder / SUMMARY, self.summary["parameters"]
        try:
            known = self.parameters.resolved()
        except ParameterError as error:
            text = f"{path}: is of another version ({error}); {MAKE_AGAIN}"
            raise ResultsError(text, file=path) from error
        for block, values in known.items():
            for name in values:
                if name not in kept.get(block, {}):
                    raise ResultsError(
                        f"{path}: its parameters.{block}.{name} is missing; {MAKE_AGAIN}", file=path
                    )

    def _require_rows(self, results: dict[str, Any]) -> None:
        """Refuse tables that have not one row for each map, track and event of the whole run's results."""
        import pyarrow.parquet as pq

        maps, tracks, events = results["snapshots"], results["tracks"], sum(results["events"].values())
        for name, count in {"snapshots": maps, "maps": maps, "tracks": tracks, "events": events}.items():
            path = self.folder / f"{name}.parquet"
            with _reading(path):
                held = pq.read_metadata(path).num_rows
            if held != count:
                rows = counted(held, "row") if held else "no map" if name == "snapshots" else "no row"
                text = f"{path}: holds {rows}, not {count} as {SUMMARY} says; {MAKE_AGAIN}"
                raise ResultsError(text, file=path)

    @cached_property
    def names(self) -> dict[int, str]:
        """Names that rooms were given, by track."""
        rows = self.table("tracks", ["track", "name"]).to_pylist()
        return {row["track"]: row["name"] for row in rows if row["name"]}

    def name_of(self, track: int) -> str:
        """Return what a room is called."""
        return room_name(track, self.names.get(track, ""))

    def rename(self, path: str | Path) -> None:
        """Call rooms by other names than the run has stored; those that it names not keep theirs.

        Parameters
        ----------
        path : str or path
            As for the option ``names`` of `RunOptions`; points and outlines are those of the last map, and
            name rooms of its part alone.

        Raises
        ------
        ParameterError
            If the names cannot be read, or a plan of outlines does not fit the last map.
        ResultsError
            If the results cannot be read.
        """
        last = self.choose()
        below, _ = self.map(last)
        snapshot = OccupancySnapshot(last, 0, 0, "", below.cells, below.geometry)
        given = names_in(snapshot, expanded(Path(path)), self.parameters, below.occupancy)
        rows = self.table("tracks").to_pylist()
        tracks = [row["track"] for row in rows]
        shapes = self.shapes("tracks", [row["polygon_wkb"] for row in rows])
        named = self.part or next(reversed(self.parts), ONLY_PART)
        in_frame = [
            shape if row["part"] == named else shapely.Polygon()
            for row, shape in zip(rows, shapes, strict=True)
        ]
        found = given.of(tracks, in_frame)
        all_tracks = (
            tracks if self.part is None else StoredRun(self.folder).table("tracks")["track"].to_pylist()
        )
        tell_unused(Path(path), given.unused(found, all_tracks))
        self.names.update({track: name for track, name in zip(tracks, found, strict=True) if name})

    @property
    def annotated_log(self) -> Path | None:
        """The annotated MCAP, None if the run wrote none or it is gone."""
        names = [name for name in self.summary["files"] if str(name).endswith(ANNOTATED_ENDING)]
        paths = [self.folder / Path(name).name for name in names]
        return next((path for path in paths if path.is_file()), None)

    @property
    def is_back_projected(self) -> bool:
        """Whether the run has a table of back-projected rooms."""
        # One that the summary does not name is of an earlier run.
        name = f"{BACK_PROJECTED}.parquet"
        return name in self.summary["files"] and (self.folder / name).is_file()

    def table(self, name: str, columns: list[str] | None = None, snapshot: int | None = None) -> pa.Table:
        """Read a table, or some of its columns, or its rows of one map.

        Raises
        ------
        ResultsError
            If it is not there, cannot be read or lacks a column.
        """
        import pyarrow.parquet as pq

        if name not in (*TABLES, BACK_PROJECTED):
            raise ParameterError(f"no table {name!r}; there are {', '.join((*TABLES, BACK_PROJECTED))}")
        path = self.folder / f"{name}.parquet"
        rows = [] if snapshot is None else [("snapshot", "=", snapshot)]
        rows += [] if self.part is None else [("part", "=", self.part)]
        schema = self._schema(name)  # the file may have changed since the folder was opened
        with _reading(path):
            read = pq.read_table(path, columns=columns, filters=rows or None, partitioning=None)
        for field in schema:
            if not field.nullable and field.name in read.column_names and read[field.name].null_count:
                raise ResultsError(f"{path}: its column {field.name} lacks values; {MAKE_AGAIN}", file=path)
        return read

    def _schema(self, name: str) -> pa.Schema:
        """Return the schema of a table, which its file has.

        Raises
        ------
        ResultsError
            If the file cannot be read, or a column is missing or of another type.
        """
        import pyarrow.parquet as pq

        from rose2_logs.runs.table_schemas import SCHEMAS

        path = self.folder / f"{name}.parquet"
        with _reading(path):
            found = pq.read_schema(path)
        wanted = SCHEMAS[name]
        for field in wanted:
            at = found.get_field_index(field.name)
            if at < 0 or found.field(at).type != field.type:
                lack = "is missing" if at < 0 else f"is of type {found.field(at).type}, not {field.type}"
                raise ResultsError(f"{path}: its column {field.name} {lack}; {MAKE_AGAIN}", file=path)
        return wanted

    def shapes(self, name: str, wkb: list[bytes]) -> list[BaseGeometry]:
        """Read shapes of a table.

        Raises
        ------
        ResultsError
            If one is damaged.
        """
        try:
            return shapely.from_wkb(wkb).tolist()  # type: ignore[no-any-return]
        except shapely.errors.ShapelyError as error:
            path = self.folder / f"{name}.parquet"
            text = f"{path}: its column polygon_wkb holds what is no shape: {error}; {MAKE_AGAIN}"
            raise ResultsError(text, file=path) from error

    @cached_property
    def columns(self) -> dict[str, NDArray[Any]]:
        """Columns of the table of snapshots as arrays; null is NaN."""
        table = self.table("snapshots")
        if not table.num_rows:
            path = self.folder / "snapshots.parquet"
            raise ResultsError(f"{path}: holds no map; {MAKE_AGAIN}", file=path)
        return {name: table[name].to_numpy(zero_copy_only=False) for name in table.column_names}

    def choose(self, snapshot: int | None = None, coverage: float | None = None) -> int:
        """Return the number of a map; see `at`."""
        if snapshot is not None and coverage is not None:
            raise ParameterError("a map is chosen by its snapshot or by its coverage; give only one of them")
        numbers = self.columns["snapshot"]
        if snapshot is not None:
            if not _is_number(snapshot, Integral):
                raise ParameterError(f"the snapshot is a whole number, not {snapshot!r}")
            if snapshot not in numbers:
                raise ParameterError(
                    f"{self.folder}: no snapshot {snapshot}; they go from {numbers[0]} to {numbers[-1]}"
                )
            return int(snapshot)
        if coverage is None:
            return int(numbers[-1])
        if not _is_number(coverage, Real):
            raise ParameterError(f"the coverage is a number from 0 to 1, not {coverage!r}")
        if not 0 <= coverage <= 1:
            raise ParameterError(f"the coverage is a share from 0 to 1, not {coverage:g}; half is 0.5")
        # Each part has its own coverage; that of the last one leads to the run's last map.
        part = self.columns["part"]
        covered = np.flatnonzero((self.columns["coverage"] >= coverage) & (part == part[-1]))
        return int(numbers[covered[0]] if len(covered) else numbers[-1])

    def row(self, snapshot: int) -> Row:
        """Return the row of a map in the table of snapshots."""
        (place,) = np.flatnonzero(self.columns["snapshot"] == snapshot)
        return {name: values[place] for name, values in self.columns.items()}

    def geometry(self, snapshot: int) -> GridGeometry:
        """Where the grid of a map lies.

        Raises
        ------
        ResultsError
            If the grid is none, or larger than the run could have read.
        """
        row = self.row(snapshot)
        path = self.folder / "snapshots.parquet"
        shape = int(row["height_cells"]), int(row["width_cells"])
        most = self.parameters.reading.map_max_cells
        if min(shape) < 1 or shape[0] * shape[1] > most:
            text = f"{path}: map {snapshot} cannot have {shape[0]} x {shape[1]} cells; {MAKE_AGAIN}"
            raise ResultsError(text, file=path)
        try:
            return GridGeometry(
                float(row["resolution_m"]),
                (float(row["origin_x_m"]), float(row["origin_y_m"])),
                float(row["yaw_rad"]),
                str(row["frame_id"]),
                shape,
            )
        except InvalidMapError as error:
            raise ResultsError(f"{path}: map {snapshot}: {error}; {MAKE_AGAIN}", file=path) from error

    def drift(self, snapshot: int) -> RigidMotion:
        """How the whole map moved from the run's first map to this one."""
        row = self.row(snapshot)
        return RigidMotion((0.0, 0.0), (row["drift_x_m"], row["drift_y_m"]), row["drift_yaw_rad"])

    def map(self, snapshot: int) -> tuple[PlanMap, tuple[slice, slice]]:
        """Read a map and the tracks of its cells, as its explored window, and its place in the grid.

        Raises
        ------
        ResultsError
            If the table of maps cannot be read.
        """
        path = self.folder / "maps.parquet"
        (stored, *_) = self.table("maps", snapshot=snapshot).to_pylist() or [None]
        if stored is None:
            raise ResultsError(f"{path}: holds no map {snapshot}; {MAKE_AGAIN}", file=path)
        shape = (stored["rows"], stored["columns"])
        top, left = stored["first_row"], stored["first_column"]
        window = slice(top, top + shape[0]), slice(left, left + shape[1])
        geometry = self.geometry(snapshot)
        if (
            min(*shape, top, left) < 0
            or window[0].stop > geometry.shape[0]
            or window[1].stop > geometry.shape[1]
        ):
            raise ResultsError(f"{path}: map {snapshot} does not fit its grid; {MAKE_AGAIN}", file=path)
        try:
            cells = unpack_image(stored["cells_zstd"], shape, "i1")
            labels = unpack_image(stored["labels_zstd"], shape, "<i4")
        except ValueError as error:
            text = f"{path}: map {snapshot} cannot be read: {reason_of(error)}; {MAKE_AGAIN}"
            raise ResultsError(text, file=path) from error
        return PlanMap(geometry.part(window), cells, labels.astype(np.int32), self.occupancy), window

    @property
    def occupancy(self) -> OccupancyParameters:
        """The run's parameters for stored maps, whose classes the default thresholds distinguish."""
        usual = OccupancyParameters()
        return replace(
            self.parameters.occupancy,
            occupied_min_percent=usual.occupied_min_percent,
            free_max_percent=usual.free_max_percent,
        )

    def found_walls(self, snapshot: int) -> Walls | None:
        """Read the walls of a map; None if the method finds none."""
        if self.summary["method"] != "rose2":
            return None
        segments, lines = (self.table(name, snapshot=snapshot) for name in ("walls", "lines"))
        return Walls(
            segments_m=_ends(segments),
            segment_direction=segments["direction"].to_numpy(),
            segment_cluster=segments["line"].to_numpy(),
            lines_m=_ends(lines),
            line_direction=lines["direction"].to_numpy(),
            line_weight=lines["weight"].to_numpy(),
        )

    def plan(self, snapshot: int, *, with_map: bool = True, with_walls: bool = False) -> RoomPlan:
        """Return the floor plan of a map, whose rooms are numbered by their tracks.

        Parameters
        ----------
        snapshot : int
            Its number.
        with_map : bool
            Whether to read the map too; without it there are shapes alone.
        with_walls : bool
            Whether to read the wall segments too.

        Raises
        ------
        ResultsError
            If a file cannot be read.
        """
        row = self.row(snapshot)
        rows = self.table("rooms", snapshot=snapshot).to_pylist()
        shapes = self.shapes("rooms", [each["polygon_wkb"] for each in rows])
        names = self.names
        rooms = [
            _room(each, shape, names.get(each["track"], "")) for each, shape in zip(rows, shapes, strict=True)
        ]
        doorways = [_doorway(each) for each in self.table("doorways", snapshot=snapshot).to_pylist()]
        borders = [_border(each) for each in self.table("borders", snapshot=snapshot).to_pylist()]
        walls = self.found_walls(snapshot) if with_walls else None
        return RoomPlan(
            f"{self.name}, snapshot {snapshot}, coverage {percent(float(row['coverage']))}",
            str(row["frame_id"]),
            tuple(sorted(rooms, key=lambda room: room.number)),
            tuple(doorways),
            None if walls is None else walls.segments_m.reshape(-1, 2, 2),
            self.map(snapshot)[0] if with_map else None,
            tuple(borders),
        )


def _is_number(value: object, kind: type) -> bool:
    return isinstance(value, kind) and not isinstance(value, bool)


def _read_summary(folder: Path) -> dict[str, Any]:
    path = folder / SUMMARY
    if not path.is_file():
        if folder.is_file():
            raise ResultsError(f"{folder}: is a file, not a folder of results", file=folder)
        below = min((found.parent for found in folder.rglob(SUMMARY)), default=None)
        hint = f"did you mean {below}?" if below else "an analysis writes such a folder for each log"
        raise ResultsError(f"{folder}: holds no {SUMMARY}; {hint}", file=folder)
    try:
        summary = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise ResultsError(f"{path}: cannot be read: {reason_of(error)}; {MAKE_AGAIN}", file=path) from error
    if not isinstance(summary, dict) or not {"log", "topic", "results"} & summary.keys():
        raise ResultsError(f"{path}: is not the summary of a run; give a folder of results", file=path)
    if summary.get("results_format") != RESULTS_FORMAT:
        versions = summary.get("versions")
        version = versions.get("rose2-logs") if isinstance(versions, dict) else None
        written_by = f"rose2-logs {version}" if version else "another version"
        raise ResultsError(
            f"{folder}: was written by {written_by}, whose results this version cannot read; "
            f"{MAKE_AGAIN} ({summary.get('log', 'no name is kept')}) to another folder, or overwrite this "
            "one",
            file=path,
        )
    if lack := what_it_lacks(summary):
        raise ResultsError(f"{path}: {lack}; {MAKE_AGAIN}", file=path)
    return summary


def _ends(table: pa.Table) -> NDArray[np.float64]:
    """Ends (N, 4) of lines."""
    return np.column_stack([table[name].to_numpy() for name in ("x0_m", "y0_m", "x1_m", "y1_m")])


@contextmanager
def _reading(path: Path) -> Iterator[None]:
    """Turn what goes wrong with a table's file into one line that names it."""
    import pyarrow as pa

    try:
        yield
    except FileNotFoundError as error:
        raise ResultsError(f"{path}: there is no such file; {MAKE_AGAIN}", file=path) from error
    except (OSError, pa.ArrowException) as error:
        why = " ".join(str(error).split())
        raise ResultsError(f"{path}: cannot be read: {why}; {MAKE_AGAIN}", file=path) from error


def _room(row: Row, shape: BaseGeometry, name: str) -> PlanRoom:
    point = (row["label_x_m"], row["label_y_m"])
    return PlanRoom(
        row["track"],
        shape,
        row["area_m2"],
        None if point[0] is None else point,
        tuple(row["neighbors"]),
        row["wall_support"],
        row["frontier_m"],
        name,
    )


def _doorway(row: Row) -> Doorway:
    ends = np.array([[row["x0_m"], row["y0_m"]], [row["x1_m"], row["y1_m"]]])
    return Doorway((row["track_a"], row["track_b"]), ends)


def _border(row: Row) -> Border:
    return Border((row["track_a"], row["track_b"]), row["kind"], row["width_m"], row["strength"])
