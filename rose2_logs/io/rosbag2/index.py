"""One SQLite database of a ROS 2 bag: its channels, where their messages are, and the bytes of each.

Truncated or damaged databases are read too: rows on lost pages are skipped.
Format: https://github.com/ros2/rosbag2, rosbag2_storage_sqlite3
"""

from __future__ import annotations

import logging
import sqlite3
from collections import Counter
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from rose2_logs.config.reading import ReadingParameters
from rose2_logs.config.times import LATEST_NS
from rose2_logs.errors import LogError
from rose2_logs.io.log_file import (
    Channel,
    LogFile,
    Place,
    StoredMessage,
    check_count,
    warn_of_times,
)
from rose2_logs.io.source import DamagedMessageError
from rose2_logs.system.files import OnFailure
from rose2_logs.system.warnings import log_warning

logger = logging.getLogger(__name__)

_ROW_DTYPE = np.dtype([("time", "<i8"), ("row", "<i8"), ("channel", "<i8")])
# Rows that are fetched from a database at once.
_ROWS_AT_ONCE = 10_000
_LAST_ROW = 2**62
# Marks rows whose time or topic is not a number.
_NO_CHANNEL = -1
# What a damaged database, or a damaged text in it, raises.
_DAMAGE = (sqlite3.Error, ValueError, TypeError, OverflowError, LookupError, MemoryError)


class SqliteFile(LogFile):
    """An open database; neither it nor any file next to it is ever written to.

    Parameters
    ----------
    path : Path
    limits : ReadingParameters
        The largest sizes that are accepted.

    Raises
    ------
    LogError
        If it cannot be opened, is not the database of a bag, or has more map messages than the limit.
    """

    def __init__(self, path: Path, limits: ReadingParameters) -> None:
        self.path = path
        self.limits = limits
        self.indexed = True
        self.channels: dict[int, Channel] = {}
        try:
            self._base = sqlite3.connect(
                f"file:{quote(str(path.resolve()))}?immutable=1", uri=True, check_same_thread=False
            )
        except sqlite3.Error as error:
            raise LogError(f"{path}: cannot be opened: {error}", file=path) from error
        with OnFailure(self.close):
            try:
                self._set_up()
                self._read_channels()
                rows = self._read_rows()
                self._rows = rows[rows["channel"] != _NO_CHANNEL]
                warn_of_times(path, len(rows) - len(self._rows))
            except _DAMAGE as error:
                raise LogError(
                    f"{path}: cannot be read as a bag: {error}; try `sqlite3 {path.name} .recover`", file=path
                ) from error
        channels, counts = np.unique(self._rows["channel"], return_counts=True)
        self.message_counts = Counter(dict(zip(channels.tolist(), counts.tolist(), strict=True)))
        times = self._rows["time"]
        self.start_ns = int(times.min()) if len(times) else None
        self.end_ns = int(times.max()) if len(times) else None
        self._look_for_journal()

    def close(self) -> None:
        """Close the file; may be called more than once."""
        self._base.close()

    def places(self, channel_ids: Collection[int]) -> list[Place]:
        """Where the messages of some channels are stored, in log time order."""
        chosen = self._rows[np.isin(self._rows["channel"], list(channel_ids))]
        check_count(self.path, len(chosen), self.limits.map_max_messages)
        return sorted(Place(time, row, -1, channel) for time, row, channel in chosen.tolist())

    def payload(self, place: Place) -> memoryview:
        """Return the data of one message.

        Raises
        ------
        DamagedMessageError
            If it is on lost pages, or larger than the limit.
        """
        try:
            return self._payload(place.record)
        except _DAMAGE as error:
            raise DamagedMessageError(f"damaged ({error})") from error

    def _payload(self, row: int) -> memoryview:
        found = self._base.execute("SELECT data FROM messages WHERE rowid = ?", (row,)).fetchone()
        if found is None or not isinstance(found[0], bytes):
            raise ValueError("its row is lost")
        return memoryview(found[0])

    def messages(self, channel_ids: Collection[int] | None = None) -> Iterator[StoredMessage]:
        """Yield every readable message of some channels, or of all, in log time order."""
        sequence: Counter[int] = Counter()
        rows = self._rows
        if channel_ids is not None:
            rows = rows[np.isin(rows["channel"], list(channel_ids))]
        for entry in rows[np.argsort(rows["time"], kind="stable")]:
            time, row, channel_id = entry.item()
            try:
                data, channel = self._payload(row), self.channels[channel_id]
            except _DAMAGE:
                continue
            yield StoredMessage(channel, time, time, sequence[channel_id], data)
            sequence[channel_id] += 1

    def _set_up(self) -> None:
        """Prepare to read a database that may be truncated; nothing that it defines is trusted."""
        self._base.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, min(self.limits.chunk_max_bytes, 2**31 - 1))
        self._base.text_factory = lambda text: text.decode("utf-8", errors="replace")
        for pragma in ("writable_schema = ON", "trusted_schema = OFF", "mmap_size = 0"):
            self._base.execute(f"PRAGMA {pragma}")
        # A view could hide an endless query.
        tables = self._base.execute(
            "SELECT count(*) FROM sqlite_master WHERE type = 'table' AND name IN ('messages', 'topics')"
        ).fetchone()
        if tables[0] != 2:
            raise ValueError("it lacks the tables `messages` and `topics`")

    def _read_channels(self) -> None:
        columns = [str(row[1]) for row in self._base.execute("PRAGMA table_info(topics)")]
        definitions = self._definitions()
        for row in self._base.execute("SELECT * FROM topics"):
            about = dict(zip(columns, row, strict=True))
            if missing := {"id", "name", "type", "serialization_format"} - about.keys():
                raise ValueError(f"its table `topics` has no column {min(missing)}")
            name = str(about["type"])
            number, (encoding, text) = int(about["id"]), definitions.get(name, ("", ""))
            qos = about.get("offered_qos_profiles")
            self.channels[number] = Channel(
                number,
                str(about["name"]),
                str(about["serialization_format"]),
                number + 1,
                name,
                encoding,
                text.encode(),
                {"offered_qos_profiles": str(qos)} if qos else {},
            )

    def _definitions(self) -> dict[str, tuple[str, str]]:
        """Language and text of the type definitions that newer bags contain."""
        query = "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
        try:
            rows = self._base.execute(query)
            return {str(name): (str(language), str(text)) for name, language, text in rows}
        except sqlite3.Error:
            return {}

    def _read_rows(self) -> Any:
        """Time, row and channel of every message that can be reached, in row order."""
        parts: list[Any] = [np.empty(0, _ROW_DTYPE)]
        last, step = -1, 0
        while last + step < _LAST_ROW:
            found: list[tuple[int, int, int]] = []
            error = self._take_rows(last + step, found)
            if found:
                parts.append(np.array(found, _ROW_DTYPE))
                last, step = found[-1][1], 0
            if error is None and len(found) < _ROWS_AT_ONCE:
                break
            if error is not None:
                if step == 0:
                    self.whole = False
                    text = f"{self.path}: damaged or truncated ({error}) after row {max(last, 0)}; only the "
                    log_warning(
                        logger, "cut_off", f"{text}messages that can be reached are read", file=self.path
                    )
                # Skip the lost pages, doubling the step each time.
                step = 2 * step or 1
        return np.concatenate(parts)

    def _take_rows(self, after: int, found: list[tuple[int, int, int]]) -> Exception | None:
        """Append the next `_ROWS_AT_ONCE` rows to `found`, and return the error if one occurred."""
        query = "SELECT timestamp, rowid, topic_id FROM messages WHERE rowid > ? ORDER BY rowid LIMIT ?"
        try:
            for time, row, channel in self._base.execute(query, (after, _ROWS_AT_ONCE)):
                if row <= after:
                    return sqlite3.DatabaseError("rows out of order")
                after = row
                is_usable = isinstance(time, int) and isinstance(channel, int) and 0 <= time <= LATEST_NS
                found.append((time, row, channel) if is_usable else (0, row, _NO_CHANNEL))
        except (sqlite3.Error, MemoryError) as error:  # MemoryError if a row claims to be huge
            return error
        return None

    def _look_for_journal(self) -> None:
        """Warn if the recorder left messages in SQLite's journal, which reading alone cannot recover."""
        journal = self.path.with_name(f"{self.path.name}-wal")
        if journal.is_file() and journal.stat().st_size:
            text = (
                f"{self.path}: {journal.name} contains messages that are not in the database yet; they are "
                f"skipped; to include them, run `sqlite3 {self.path.name} .tables` on a copy of both files"
            )
            log_warning(logger, "journal", text, file=self.path)
