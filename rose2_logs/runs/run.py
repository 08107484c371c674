"""Run: a stored run as people use it: tables, maps, label images, figures."""

from __future__ import annotations

import operator
import weakref
from collections.abc import Iterator, Sequence
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, NoReturn, Self, overload

import numpy as np
from numpy.typing import NDArray

from rose2_logs.errors import ResultsError
from rose2_logs.model.occupancy import UNKNOWN, GridGeometry
from rose2_logs.model.room_plan import PlanMap, RoomPlan
from rose2_logs.runs.parquet_table import Row
from rose2_logs.runs.stored_run import StoredRun
from rose2_logs.runs.table import Table
from rose2_logs.runs.tables import BACK_PROJECTED
from rose2_logs.system.files import expanded
from rose2_logs.system.text import counted, percent

if TYPE_CHECKING:
    from rose2_logs.drawing.drawing import Drawing


class _TemporaryResults:
    """Removes a folder when the last run that shows it, or copy of it, is gone."""

    def __init__(self, temporary: TemporaryDirectory[str]) -> None:
        # Without this, Python warns that the folder is removed implicitly.
        weakref.finalize(self, temporary.cleanup)

    def __deepcopy__(self, _memory: object) -> Self:
        return self

    def __reduce__(self) -> NoReturn:
        raise ResultsError(
            "these results lie in a temporary folder that goes with their Run; to hand it to another "
            "process, analyze with out=..."
        )


def is_last(final: dict[str, Any], last: int) -> bool:
    """Whether a layout was final in the last map only, of several: so it may change again."""
    return bool(final["snapshot"] == last > 0)


class Run(StoredRun, Sequence["RunSnapshot"]):
    """A run over one log, as an analysis has stored it: a sequence of `RunSnapshot`.

    Parameters
    ----------
    folder : str or path
        The folder with ``summary.json``.
    temporary : TemporaryDirectory, optional
        Holds the folder, which is deleted together with this object.
    part : int, optional
        Take one part alone of a run in which maps were begun anew; `parts` lists them. Of other runs, part 1
        is all of it.

    Attributes
    ----------
    folder : path
    summary : dict
        The content of ``summary.json``; of a part, with its results and layout.
    part : int or None
        The part that was taken alone.

    Raises
    ------
    ResultsError
        If the folder is not one of results, its summary cannot be read, or it is of another version.
    ParameterError
        If there is no such part.
    OutputError
        If its name is not UTF-8.

    Examples
    --------
    >>> import rose2_logs as rl
    >>> run = rl.analyze("sample_logs/office.mcap", max_snapshots=3)
    >>> run
    <Run office: 3 maps, 18 rooms at the end>
    >>> run[-1].labels.shape == run[-1].geometry.shape
    True
    """

    def __init__(
        self,
        folder: str | Path,
        temporary: TemporaryDirectory[str] | None = None,
        *,
        part: int | None = None,
    ) -> None:
        super().__init__(expanded(Path(folder)), part)
        self._temporary = None if temporary is None else _TemporaryResults(temporary)

    @property
    def snapshots(self) -> Table:
        """One row per map."""
        return self._public("snapshots")

    @cached_property
    def rooms(self) -> Table:
        """One row per room and map; `in_last_map`: whether the last map of its part shows its track."""
        import pyarrow as pa

        rows, tracks = self.table("rooms"), self.table("tracks", ["track", "in_last_map"])
        last = tracks["track"].to_numpy()[tracks["in_last_map"].to_numpy(zero_copy_only=False)]
        column = pa.array(np.isin(rows["track"].to_numpy(), last))
        meaning = {"description": "whether the last map of its part shows the room's track"}
        field = pa.field("in_last_map", pa.bool_(), nullable=False, metadata=meaning)
        return Table("rooms", rows.append_column(field, column))

    @property
    def tracks(self) -> Table:
        """One row per room over the run."""
        return self._public("tracks")

    @property
    def events(self) -> Table:
        """One row per event: rooms born, split, merged, lost ..., shifts of the whole map."""
        return self._public("events")

    @property
    def doorways(self) -> Table:
        """One row per doorway and map."""
        return self._public("doorways")

    @property
    def borders(self) -> Table:
        """One row per pair of neighboring rooms and map: wall, door or opening, and how sure it is."""
        return self._public("borders")

    @property
    def walls(self) -> Table:
        """One row per wall segment and map."""
        return self._public("walls")

    @property
    def lines(self) -> Table:
        """One row per representative line and map."""
        return self._public("lines")

    @property
    def back_projected(self) -> Table | None:
        """One row per room of the last map and map that shows some of it; None if it was not requested."""
        return self._public(BACK_PROJECTED) if self.is_back_projected else None

    def at(self, snapshot: int | None = None, coverage: float | None = None) -> RunSnapshot:
        """Return a map: that of a number, or the first that covers so much, or the last.

        Parameters
        ----------
        snapshot : int, optional
            Its number, as in the tables.
        coverage : float, optional
            Share in [0, 1] of the last map's known free area.

        Raises
        ------
        ParameterError
            If there is no such map, the coverage is no share, or both are given.
        """
        return RunSnapshot(self, self.choose(snapshot, coverage))

    def at_coverage(self, coverage: float) -> RunSnapshot:
        """Return the first map that covers a share of what the last one does; see `at`."""
        return self.at(coverage=coverage)

    def figure(
        self, snapshot: int | None = None, coverage: float | None = None, *, back_projected: bool = False
    ) -> Drawing:
        """Draw a map with its rooms; see `at` and `RunSnapshot.figure`."""
        return self.at(snapshot, coverage).figure(back_projected=back_projected)

    def plot(
        self,
        ax: Any = None,
        snapshot: int | None = None,
        coverage: float | None = None,
        *,
        back_projected: bool = False,
    ) -> Any:
        """Draw a map with its rooms with matplotlib; see `at` and `RunSnapshot.plot`."""
        return self.at(snapshot, coverage).plot(ax, back_projected=back_projected)

    def __len__(self) -> int:
        return len(self.columns["snapshot"])

    @overload
    def __getitem__(self, index: int) -> RunSnapshot: ...
    @overload
    def __getitem__(self, index: slice) -> list[RunSnapshot]: ...
    def __getitem__(self, index: int | slice) -> RunSnapshot | list[RunSnapshot]:
        numbers = self.columns["snapshot"]
        if isinstance(index, slice):
            return [RunSnapshot(self, int(number)) for number in numbers[index]]
        try:
            place = operator.index(index)
        except TypeError:
            place = None
        if place is None or isinstance(index, bool):
            kind = type(index).__name__
            raise TypeError(f"the maps of a run have whole numbers and slices as indices, not {kind}")
        if not -len(numbers) <= place < len(numbers):
            raise IndexError(f"run {self.name} has {counted(len(numbers), 'map')}; none has index {place}")
        return RunSnapshot(self, int(numbers[place]))

    def __iter__(self) -> Iterator[RunSnapshot]:
        return (RunSnapshot(self, int(number)) for number in self.columns["snapshot"])

    def __repr__(self) -> str:
        found = self.summary["results"]
        maps, rooms = counted(found["snapshots"], "map"), counted(found["rooms_last"], "room")
        return f"<Run {self.name}: {maps}, {rooms} at the end>"

    def _repr_html_(self) -> str:
        from html import escape

        found, final = self.summary["results"], self.summary["layout"].get("final_since")
        facts = {
            "log": self.summary["log"],
            "maps": found["snapshots"],
            "rooms at the end": f"{found['rooms_last']} of {found['tracks']} tracks",
            "layout final from": "not reached"
            if final is None or is_last(final, self.choose())
            else f"{percent(final['coverage'])} coverage",
            "warnings": self.summary["warnings"].get("count", 0),
        }
        rows = "".join(f"<tr><th>{escape(k)}</th><td>{escape(str(v))}</td></tr>" for k, v in facts.items())
        return f"<h4>{escape(self.name)}</h4><table>{rows}</table>{self[-1]._repr_svg_()}"

    def _public(self, name: str) -> Table:
        if name not in self._tables:
            self._tables[name] = Table(name, self.table(name))
        return self._tables[name]

    @cached_property
    def _tables(self) -> dict[str, Table]:
        return {}


def named_run(folder: Path, names: Path | None, part: int | None = None) -> Run:
    """Open a stored run, or a part of it; its rooms have other names where a file of names is given."""
    run = Run(folder, part=part)
    if names is not None:
        run.rename(names)
    return run


class RunSnapshot:
    """One map of a stored run; equal to the same map of the same run, however that was opened.

    Attributes
    ----------
    run : Run
    number : int
        Its number in the tables.

    Examples
    --------
    >>> import rose2_logs as rl
    >>> run = rl.analyze("sample_logs/office.mcap", max_snapshots=3)
    >>> run[0]
    <RunSnapshot 0 of office: coverage 26%, 6 rooms>
    """

    def __init__(self, run: Run, number: int) -> None:
        self.run = run
        self.number = number

    @cached_property
    def _identity(self) -> tuple[Path, int]:
        return self.run.folder.resolve(), self.number

    def __eq__(self, other: object) -> bool:
        return isinstance(other, RunSnapshot) and self._identity == other._identity

    def __hash__(self) -> int:
        return hash(self._identity)

    @cached_property
    def _row(self) -> Row:
        return self.run.row(self.number)

    @cached_property
    def _map(self) -> tuple[PlanMap, tuple[slice, slice]]:
        return self.run.map(self.number)

    @property
    def coverage(self) -> float:
        """Known free area over that of the last map, in [0, 1]."""
        return float(self._row["coverage"])

    @property
    def time_s(self) -> float:
        """Log time since the first map, seconds."""
        return float(self._row["time_s"])

    @property
    def log_time_ns(self) -> int:
        """When the map was recorded, nanoseconds since the epoch."""
        return int(self._row["log_time_ns"])

    @property
    def geometry(self) -> GridGeometry:
        """Where the map's grid lies."""
        return self.run.geometry(self.number)

    @cached_property
    def labels(self) -> NDArray[np.int32]:
        """Label image (H, W) on the map's grid: track of each cell's room, 0 for none. Row 0: origin."""
        stored, window = self._map
        whole = np.zeros(self.geometry.shape, np.int32)
        whole[window] = stored.labels
        return whole

    @cached_property
    def cells(self) -> NDArray[np.int8]:
        """Classes (H, W) of the map's cells: -1 unknown, 0 free, 50 between the thresholds, 100 occupied."""
        stored, window = self._map
        whole = np.full(self.geometry.shape, UNKNOWN, np.int8)
        whole[window] = stored.cells
        return whole

    @cached_property
    def rooms(self) -> Table:
        """One row per room."""
        return Table("rooms", self.run.table("rooms", snapshot=self.number))

    @cached_property
    def doorways(self) -> Table:
        """One row per doorway."""
        return Table("doorways", self.run.table("doorways", snapshot=self.number))

    @cached_property
    def borders(self) -> Table:
        """One row per pair of neighboring rooms."""
        return Table("borders", self.run.table("borders", snapshot=self.number))

    @cached_property
    def walls(self) -> Table:
        """One row per wall segment."""
        return Table("walls", self.run.table("walls", snapshot=self.number))

    @cached_property
    def lines(self) -> Table:
        """One row per representative line."""
        return Table("lines", self.run.table("lines", snapshot=self.number))

    def plan(self, *, back_projected: bool = False) -> RoomPlan:
        """Return the floor plan: rooms by their tracks, doorways, walls and the map.

        Parameters
        ----------
        back_projected : bool
            Take the rooms of the last map as far as this one shows them, instead of those found in it.
        """
        if back_projected:
            from rose2_logs.runs.back_projected_plan import back_projected_plan

            return back_projected_plan(self.run, self.number)
        return self.run.plan(self.number, with_walls=True)

    def figure(self, *, back_projected: bool = False) -> Drawing:
        """Draw the map with its rooms, unseen parts, doorways and a scale bar.

        Returns
        -------
        Drawing
            Shown in notebooks; ``drawing.save("plan.svg")`` or ``.png`` writes it.
        """
        from rose2_logs.drawing.plan import draw_plan

        return draw_plan(self.plan(back_projected=back_projected))

    def plot(self, ax: Any = None, *, back_projected: bool = False) -> Any:
        """Draw the map with its rooms with matplotlib.

        Parameters
        ----------
        ax : matplotlib Axes, optional
            Axes to draw into; by default new ones.
        back_projected : bool
            As for `plan`.

        Returns
        -------
        matplotlib Axes

        Raises
        ------
        MissingPackageError
            If matplotlib is not installed.
        """
        from rose2_logs.drawing.plot import plot_plan

        return plot_plan(self.plan(back_projected=back_projected), ax)

    def __repr__(self) -> str:
        about = f"coverage {percent(self.coverage)}, {counted(int(self._row['rooms']), 'room')}"
        return f"<RunSnapshot {self.number} of {self.run.name}: {about}>"

    def _repr_svg_(self) -> str:
        return self.figure()._repr_svg_()
