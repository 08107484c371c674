"""Results in an object store: workers upload those of each log, its record last, which proves them whole."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from contextlib import AbstractContextManager
from pathlib import Path

from rose2_logs.batch.dataset import EVERY_TABLE, PARTITION, TABLES_FOLDER
from rose2_logs.batch.folders import LOGS_FOLDER, WORK_FOLDER
from rose2_logs.batch.record import RECORD
from rose2_logs.batch.remote import asking, file_system
from rose2_logs.runs.summary import SUMMARY

AT_ONCE = 500
"""Small files that are fetched side by side and held in memory at the same time."""


class Store:
    """A folder for results behind a URL, as workers and the process that runs the batch see it.

    It has no locks: whoever opens it last is the one whose workers may write.

    Parameters
    ----------
    url : str
        The folder.
    run : str
        Name of this run of a batch.

    Raises
    ------
    LogError
        In each method, if the store cannot be reached, read or written; also if its packages are missing.
    """

    def __init__(self, url: str, run: str) -> None:
        self.url = url
        self._files, self._path = file_system(url)
        self._mark = f"{self._path}/{WORK_FOLDER}/{run}"

    def open(self) -> None:
        """Begin to write, in place of any other batch; fails before any work is done if it cannot be."""
        with self._asking():
            for mark in self._files.find(f"{self._path}/{WORK_FOLDER}"):
                self._files.rm_file(mark)
            self._files.pipe_file(self._mark, b"")

    def is_open(self) -> bool:
        """Whether no other batch has begun since, and this one has not ended."""
        with self._asking():
            self._files.invalidate_cache()
            return bool(self._files.exists(self._mark))

    def close(self) -> None:
        """Leave it to others."""
        if self.is_open():
            with self._asking():
                self._files.rm_file(self._mark)

    def fetch(self, folder: Path) -> dict[str, list[str]]:
        """Copy records and summaries of the logs in the store to where a folder of results has them.

        Returns
        -------
        dict
            Names of the files that the store has of each log.
        """
        found: dict[str, list[str]] = defaultdict(list)
        logs = f"{self._path}/{LOGS_FOLDER}/"
        with self._asking():
            for path in self._files.find(logs):
                name, _, file = path.removeprefix(logs).partition("/")
                found[name].append(file)
            wanted = [f"{name}/{file}" for name in found for file in (RECORD, SUMMARY) if file in found[name]]
            for first in range(0, len(wanted), AT_ONCE):
                part = {
                    f"{logs}{each}": folder / LOGS_FOLDER / each for each in wanted[first : first + AT_ONCE]
                }
                for path, content in self._files.cat(list(part)).items():
                    part[path].parent.mkdir(parents=True, exist_ok=True)
                    part[path].write_bytes(content)
        return found

    def upload(self, results: Path, name: str) -> None:
        """Replace what the store has of a log: its record goes first and comes last, so no part counts."""
        folder = f"{self._path}/{LOGS_FOLDER}/{name}"
        files = {f"{folder}/{path.name}": path for path in sorted(results.iterdir())}
        record = files.pop(f"{folder}/{RECORD}")
        with self._asking():
            old = set(self._files.find(folder))
            if f"{folder}/{RECORD}" in old:
                self._files.rm_file(f"{folder}/{RECORD}")
            for table in EVERY_TABLE:
                partition = f"{self._path}/{TABLES_FOLDER}/{table}/{PARTITION}={name}/{table}.parquet"
                if (results / f"{table}.parquet").exists():
                    files[partition] = results / f"{table}.parquet"
                elif self._files.exists(partition):
                    self._files.rm_file(partition)
            for target, path in files.items():
                self._files.put_file(str(path), target)
            for stale in old - set(files) - {f"{folder}/{RECORD}"}:
                self._files.rm_file(stale)
        self.put(record, f"{LOGS_FOLDER}/{name}/{RECORD}")

    def put(self, file: Path, target: str) -> None:
        """Upload one file."""
        with self._asking():
            self._files.put_file(str(file), f"{self._path}/{target}")

    def withdraw_tables(self, names: Iterable[str]) -> None:
        """Remove from the data set the tables of logs other than the finished ones, and nothing else."""
        wanted = {f"{PARTITION}={name}" for name in names}
        with self._asking():
            for path in self._files.find(f"{self._path}/{TABLES_FOLDER}"):
                partition = path.split("/")[-2]
                if partition.startswith(f"{PARTITION}=") and partition not in wanted:
                    self._files.rm_file(path)

    def _asking(self) -> AbstractContextManager[None]:
        return asking(self.url, self._files, self._path)
