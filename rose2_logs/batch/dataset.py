"""The tables of all logs as one data set, partitioned by log, and a summary with one row per log."""

from __future__ import annotations

import csv
import json
import os
import shutil
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import pyarrow as pa

from rose2_logs.batch.folders import LOGS_FOLDER
from rose2_logs.runs.summary import SUMMARY
from rose2_logs.runs.tables import BACK_PROJECTED, TABLES
from rose2_logs.system.files import part_of, replacing, writing

TABLES_FOLDER = "tables"
PARTITION = "log"
SUMMARY_NAME = "summary"
EVERY_TABLE = (*TABLES, BACK_PROJECTED)

SUMMARY_COLUMNS: dict[str, tuple[pa.DataType, str]] = {
    "log": (pa.string(), "name of the log: its folder under logs/, its partition under tables/"),
    "status": (pa.string(), "done or failed"),
    "reason": (pa.string(), "why it failed"),
    "source": (pa.string(), "path or URL of the log"),
    "size_bytes": (pa.int64(), "size of the log"),
    "sha256": (pa.string(), "fingerprint of the log"),
    "method": (pa.string(), "segmentation method"),
    "version": (pa.string(), "version of rose2-logs"),
    "snapshots": (pa.int32(), "maps that were analyzed"),
    "invalid_maps": (pa.int32(), "maps that could not be analyzed"),
    "first_log_time_ns": (pa.int64(), "log time of the first map, nanoseconds since the epoch"),
    "last_log_time_ns": (pa.int64(), "log time of the last map, nanoseconds since the epoch"),
    "coverage_first": (
        pa.float64(),
        "known free area of the first map over that of the last, share in [0, 1]",
    ),
    "rooms_last": (pa.int32(), "rooms of the last map"),
    "tracks": (pa.int32(), "distinct rooms over the run"),
    "splits": (pa.int32(), "rooms that split"),
    "merges": (pa.int32(), "rooms that merged"),
    "warnings": (pa.int32(), "warnings about the log and its maps; its summary.json has them"),
    "run_s": (pa.float64(), "wall-clock time of the analysis, seconds"),
}
"""Name, type and meaning of the columns of ``summary.parquet`` and ``summary.csv``."""

Row = dict[str, Any]


def publish_tables(out: Path, name: str) -> None:
    """Make the tables of a finished log part of the data set: ``tables/TABLE/log=NAME/TABLE.parquet``.

    They are hard links to those in the log's folder where the file system has such. A log that was analyzed
    without back projection has no table of it.

    Raises
    ------
    OutputError
        If they cannot be written.
    """
    for table in EVERY_TABLE:
        source = out / LOGS_FOLDER / name / f"{table}.parquet"
        target = out / TABLES_FOLDER / table / f"{PARTITION}={name}" / f"{table}.parquet"
        with writing(target):
            if table == BACK_PROJECTED and not source.exists():
                shutil.rmtree(target.parent, ignore_errors=True)
                continue
            if _is_same(source, target):
                continue
            target.parent.mkdir(parents=True, exist_ok=True)
            part = part_of(target)
            part.unlink(missing_ok=True)
            try:
                os.link(source, part)
            except OSError:
                shutil.copy2(source, part)
            part.replace(target)


def withdraw_tables(out: Path, names: Sequence[str]) -> None:
    """Remove from the data set what belongs to none of the finished logs.

    Raises
    ------
    OutputError
        If something cannot be removed.
    """
    wanted = {f"{PARTITION}={name}" for name in names}
    for partition in (out / TABLES_FOLDER).glob(f"*/{PARTITION}=*"):
        if partition.name not in wanted:
            with writing(partition):
                shutil.rmtree(partition)


def summary_row(out: Path, name: str) -> Row:
    """Make the row of a finished log; one whose summary.json cannot be read counts as failed."""
    path = out / LOGS_FOLDER / name / SUMMARY
    try:
        kept = json.loads(path.read_text(encoding="utf-8"))
        results = kept["results"]
        return {
            "log": name,
            "status": "done",
            "reason": "",
            "source": kept["log"],
            "size_bytes": kept["input"]["size_bytes"],
            "sha256": kept["input"]["sha256"],
            "method": kept["method"],
            "version": kept["versions"]["rose2-logs"],
            "snapshots": results["snapshots"],
            "invalid_maps": results["invalid_maps"],
            "first_log_time_ns": results["first_log_time_ns"],
            "last_log_time_ns": results["last_log_time_ns"],
            "coverage_first": results["coverage_first"],
            "rooms_last": results["rooms_last"],
            "tracks": results["tracks"],
            "splits": results["events"].get("split", 0),
            "merges": results["events"].get("merged", 0),
            "warnings": kept["warnings"].get("count", 0),
            "run_s": kept["seconds"]["run"],
        }
    except (OSError, ValueError, KeyError, TypeError) as error:
        return failed_row(name, "", f"{path}: cannot be read ({error}); remove its folder and run again")


def failed_row(name: str, source: str, reason: str) -> Row:
    """Make the row of a log that failed."""
    # It may hold a name that is not UTF-8.
    text = " ".join(reason.split()).encode(errors="backslashreplace").decode()
    known = {"log": name, "status": "failed", "source": source, "reason": text}
    return dict.fromkeys(SUMMARY_COLUMNS) | known


def write_summary_tables(out: Path, rows: Sequence[Row]) -> tuple[Path, Path]:
    """Write ``summary.parquet`` and ``summary.csv``, sorted by log.

    Raises
    ------
    OutputError
        If they cannot be written.
    """
    import pyarrow.parquet as pq

    rows = sorted(rows, key=lambda row: str(row["log"]))
    fields = [
        pa.field(column, kind, metadata={"description": meaning})
        for column, (kind, meaning) in SUMMARY_COLUMNS.items()
    ]
    table = pa.Table.from_pylist(rows, pa.schema(fields))
    paths = (out / f"{SUMMARY_NAME}.parquet", out / f"{SUMMARY_NAME}.csv")
    with replacing(paths[0]) as part:
        pq.write_table(table, part, compression="zstd")
    with replacing(paths[1]) as part, part.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(SUMMARY_COLUMNS), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    return paths


def _is_same(source: Path, target: Path) -> bool:
    with suppress(FileNotFoundError):
        one, other = source.stat(), target.stat()
        return (one.st_size, one.st_mtime_ns) == (other.st_size, other.st_mtime_ns)
    return False
