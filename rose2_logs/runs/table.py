"""A table of a run as people use it: Arrow always, a pandas DataFrame where pandas is installed."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from rose2_logs.errors import MissingPackageError
from rose2_logs.system.text import counted

if TYPE_CHECKING:
    import pyarrow as pa

ROWS_SHOWN = 10
"""Rows that a notebook shows of a table where pandas is not installed."""


class Table:
    """Rows and columns of a run.

    Where pandas is installed, everything that a DataFrame can do, this can do: ``run.rooms.query(...)``,
    ``run.tracks["area_m2"].sum()``, ``run.snapshots.plot(...)``.

    Parameters
    ----------
    name : str
        What it is called.
    arrow : pyarrow.Table
        Its content.

    Attributes
    ----------
    name : str
    arrow : pyarrow.Table
        Names, types, and in each field's metadata the meaning and the unit of the columns.

    Examples
    --------
    >>> import rose2_logs as rl
    >>> run = rl.analyze("sample_logs/office.mcap", max_snapshots=3)
    >>> run.snapshots
    <Table snapshots: 3 rows, 35 columns>
    >>> run.rooms.arrow.column_names[:4]
    ['snapshot', 'log_time_ns', 'part', 'track']
    """

    def __init__(self, name: str, arrow: pa.Table) -> None:
        self.name = name
        self.arrow = arrow

    @cached_property
    def pandas(self) -> Any:
        """The table as a DataFrame.

        Raises
        ------
        MissingPackageError
            If pandas is not installed.
        """
        if find_spec("pandas") is None:
            raise MissingPackageError(
                "pandas is not installed, and only `.arrow` of a table can be used without it; "
                "install rose2-logs[notebook]"
            )
        return self.arrow.to_pandas()

    @property
    def columns(self) -> dict[str, str]:
        """Meaning and unit of each column, by name."""
        return {field.name: field.metadata[b"description"].decode() for field in self.arrow.schema}

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self.pandas, name)

    def __getitem__(self, key: Any) -> Any:
        return self.pandas[key]

    def __len__(self) -> int:
        return int(self.arrow.num_rows)

    def __iter__(self) -> Iterator[dict[str, Any]]:
        """Yield the rows as dicts."""
        yield from self.arrow.to_pylist()

    def __repr__(self) -> str:
        rows, columns = counted(len(self), "row"), counted(self.arrow.num_columns, "column")
        return f"<Table {self.name}: {rows}, {columns}>"

    def _repr_html_(self) -> str:
        if find_spec("pandas") is not None:
            return str(self.pandas._repr_html_())
        from html import escape

        rows = self.arrow.slice(0, ROWS_SHOWN).to_pylist()
        head = "".join(f"<th>{escape(name)}</th>" for name in self.arrow.column_names)
        body = "".join(
            f"<tr>{''.join(f'<td>{escape(str(value))}</td>' for value in row.values())}</tr>" for row in rows
        )
        return f"<table><tr>{head}</tr>{body}</table><p>{escape(repr(self))}</p>"
