"""A Parquet file that is written row group by row group, and appears under its name when it is whole."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

from numpy.typing import NDArray

from rose2_logs.system.files import part_of, writing

if TYPE_CHECKING:
    import pyarrow as pa
    import pyarrow.parquet as pq

ROWS_PER_GROUP = 2000
"""Rows held back until they are written as one row group: some hundred kilobytes with polygons."""
ROWS_PER_BATCH = 100
"""Rows held as Python objects, which take several times as much, until they become a batch of Arrow's."""
BYTES_PER_GROUP = 1 << 24
"""Shapes and images held back, in bytes, until they are written as a row group, however few rows they are."""
COMPRESSION = "zstd"

Row = dict[str, Any]
Columns = dict[str, NDArray[Any]]
"""Values (N,) of all columns by name."""


class ParquetTable:
    """One file: rows are added, then it is closed, then published.

    Leaving the context removes what was not published.

    Parameters
    ----------
    path : path
        Its name.
    schema : pyarrow.Schema
        Its columns.

    Attributes
    ----------
    part : path
        Where it is written until then: a hidden name in the same folder.
    """

    def __init__(self, path: Path, schema: pa.Schema) -> None:
        import pyarrow as pa

        self.part = part_of(path)
        self._path = path
        self._schema = schema
        self._binary = [field.name for field in schema if pa.types.is_binary(field.type)]
        self._rows: list[Row] = []
        self._new_rows = self._held_rows = self._held_bytes = 0
        self._batches: list[pa.RecordBatch] = []
        self._writer: pq.ParquetWriter | None = None

    def __enter__(self) -> Self:
        import pyarrow.parquet as pq

        with writing(self._path):
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._writer = pq.ParquetWriter(self.part, self._schema, compression=COMPRESSION)
        return self

    def add(self, rows: list[Row]) -> None:
        """Take rows; they are written when there are enough for a group.

        Raises
        ------
        OutputError
            If the file cannot be written.
        """
        self._rows += rows
        self._held_bytes += sum(len(row[name] or b"") for name in self._binary for row in rows)
        self._take(len(rows))

    def add_columns(self, columns: Columns) -> None:
        """Take rows as columns, which is faster where a map has many.

        Raises
        ------
        OutputError
            If the file cannot be written.
        """
        import pyarrow as pa

        if self._rows:
            self._pack()
        batch = pa.RecordBatch.from_pydict(columns, self._schema)
        self._batches.append(batch)
        self._take(batch.num_rows)

    def _take(self, rows: int) -> None:
        """Count further rows, and write what is held once it is enough."""
        self._new_rows += rows
        if self._new_rows >= ROWS_PER_BATCH:
            if self._rows:
                self._pack()
            self._held_rows += self._new_rows
            self._new_rows = 0
        if self._held_rows >= ROWS_PER_GROUP or self._held_bytes >= BYTES_PER_GROUP:
            self._flush()

    def _pack(self) -> None:
        import pyarrow as pa

        self._batches.append(pa.RecordBatch.from_pylist(self._rows, self._schema))
        self._rows = []

    def _flush(self) -> None:
        import pyarrow as pa

        if self._rows:
            self._pack()
        if self._writer is not None and self._batches:
            with writing(self._path):
                self._writer.write_table(pa.Table.from_batches(self._batches).combine_chunks())
            self._batches = []
        self._new_rows = self._held_rows = self._held_bytes = 0

    def close(self) -> None:
        """Write the last rows; the part can be read from now on.

        Raises
        ------
        OutputError
            If the file cannot be written.
        """
        self._flush()
        self._close_writer()

    def _close_writer(self) -> None:
        if self._writer is not None:
            writer, self._writer = self._writer, None
            with writing(self._path):
                writer.close()

    def publish(self) -> None:
        """Give the closed file its name.

        Raises
        ------
        OutputError
            If that cannot be done.
        """
        with writing(self._path):
            self.part.replace(self._path)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        try:
            self._close_writer()
        finally:
            self.part.unlink(missing_ok=True)
