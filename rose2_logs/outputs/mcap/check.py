"""The content of every channel of an MCAP as a number and a hash, to compare a copy with its source.

The hash of a channel is the sum, modulo 2^128, of the first 16 bytes of the SHA-256 of each of its messages
(log time, publish time and sequence as little-endian numbers, then the data). It does not depend on their
order.
"""

from __future__ import annotations

import hashlib
import struct
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Attachment, Metadata
from mcap.summary import Summary

from rose2_logs.errors import OutputError
from rose2_logs.io.mcap.index import DAMAGE, NAMED_RECORDS
from rose2_logs.io.mcap.records import MAGIC, MESSAGE, RECORD, chunk_records, parsed, records_in
from rose2_logs.outputs.mcap.input import CopiedChunk, CopiedMessage

HASH_BYTES = 16
REMEDY = "try another disk, or leave out the annotated MCAP (annotated_log=False)"
LARGEST_CHUNK_BYTES = 1 << 30
"""A chunk that claims to be larger is copied without being checked."""

_TIMES = struct.Struct("<QQI")


@dataclass
class Tally:
    """Number of messages of a channel, and the sum of their hashes."""

    messages: int = 0
    hashes: int = 0

    def add(self, log_time: int, publish_time: int, sequence: int, *data: Any) -> None:
        """Add a message; its data may be in parts."""
        digest = hashlib.sha256(_TIMES.pack(log_time, publish_time, sequence))
        for part in data:
            digest.update(part)
        self.messages += 1
        self.hashes += int.from_bytes(digest.digest()[:HASH_BYTES], "little")

    def merge(self, other: Tally) -> None:
        """Add the messages of another tally."""
        self.messages += other.messages
        self.hashes += other.hashes

    @property
    def hash(self) -> str:
        """The hash of all messages, in hexadecimal."""
        return f"{self.hashes % 256**HASH_BYTES:0{2 * HASH_BYTES}x}"

    def as_json(self) -> dict[str, Any]:
        """Return number and hash."""
        return {"messages": self.messages, "hash": self.hash}


class RecordTallies(defaultdict[str, Tally]):
    """The tally of the records that are no messages: ``attachments`` and ``metadata records``."""

    def __init__(self) -> None:
        super().__init__(Tally)

    def add(self, record: Attachment | Metadata) -> None:
        """Count a record."""
        if isinstance(record, Attachment):
            name = repr((record.name, record.media_type)).encode()
            self["attachments"].add(record.log_time, record.create_time, 0, name, record.data)
        else:
            self["metadata records"].add(0, 0, 0, repr((record.name, record.metadata)).encode())


class Tallies(defaultdict[int, Tally]):
    """The tally of each channel, by its id.

    Attributes
    ----------
    records : RecordTallies
        That of the records that are no messages.
    closed_chunks : int
        Number of chunks that cannot be checked because they are damaged or too large. Their messages are not
        counted.
    """

    def __init__(self) -> None:
        super().__init__(Tally)
        self.records = RecordTallies()
        self.closed_chunks = 0

    def watched(self, items: Iterable[CopiedMessage | CopiedChunk]) -> Iterator[CopiedMessage | CopiedChunk]:
        """Count messages while they are copied from the input; ids are those of the input."""
        for item in items:
            if isinstance(item, CopiedMessage):
                self[item.channel.key].add(item.log_time, item.publish_time, item.sequence, item.data)
            else:
                self._take_copied(item)
            yield item

    def leave_out(self, chunk: CopiedChunk) -> None:
        """Subtract a chunk that cannot be copied."""
        counted = Tallies()
        counted._take_copied(chunk)
        self.closed_chunks -= counted.closed_chunks
        for channel, tally in counted.items():
            self[channel].merge(Tally(-tally.messages, -tally.hashes))

    def _take_copied(self, chunk: CopiedChunk) -> None:
        chunk.stream.seek(chunk.index.chunk_start_offset + RECORD.size)
        self._take_chunk(chunk.stream, chunk.index.chunk_length - RECORD.size)

    def take_file(self, file: IO[bytes]) -> None:
        """Count what an MCAP file holds up to the end of its data section.

        Raises
        ------
        ValueError
            If the file is truncated.
        """
        file.seek(len(MAGIC))
        while True:
            head = file.read(RECORD.size)
            if len(head) < RECORD.size:
                raise ValueError("it is truncated")
            opcode, length = RECORD.unpack(head)
            end = file.tell() + length
            if opcode == Opcode.DATA_END:
                return
            if opcode == Opcode.CHUNK:
                self._take_chunk(file, length)
            elif opcode == Opcode.MESSAGE:
                _take_message(self, memoryview(file.read(length)))
            elif opcode in NAMED_RECORDS:
                self.records.add(parsed(NAMED_RECORDS[opcode], memoryview(file.read(length))))
            file.seek(end)

    def _take_chunk(self, file: IO[bytes], length: int) -> None:
        """Count the messages of a chunk: all of them, or none if it is damaged."""
        found: dict[int, Tally] = defaultdict(Tally)
        try:
            if length > LARGEST_CHUNK_BYTES:
                raise ValueError("too large to be checked")
            for record in records_in(chunk_records(file.read(length), LARGEST_CHUNK_BYTES)):
                if record.opcode == Opcode.MESSAGE:
                    _take_message(found, record.content)
        except DAMAGE:
            self.closed_chunks += 1
            return
        for channel, tally in found.items():
            self[channel].merge(tally)


def _take_message(tallies: dict[int, Tally], message: memoryview) -> None:
    channel, sequence, log_time, publish_time = MESSAGE.unpack_from(message)
    tallies[channel].add(log_time, publish_time, sequence, message[MESSAGE.size :])


def checked_copy(
    path: Path,
    name: str,
    copied: dict[int, Tally],
    added: dict[int, Tally],
    closed_chunks: int,
    records: RecordTallies,
) -> dict[str, Any]:
    """Read a written file back and compare it with what should have been written.

    Parameters
    ----------
    path : path
        The file.
    name : str
        Name of the file in error messages.
    copied, added : dict of int to Tally
        What was read from the input and what was added to it, by the channel ids of the file.
    closed_chunks : int
        Number of chunks of the input that cannot be checked.
    records : RecordTallies
        Attachments and metadata records, copied and added.

    Returns
    -------
    dict
        For each channel: topic, number and hash of its messages in the input and in the output; JSON values.

    Raises
    ------
    OutputError
        If a message or a record is missing, differs, or was not expected.
    """
    found = Tallies()
    try:
        with path.open("rb") as file:
            found.take_file(file)
            file.seek(0)
            summary = make_reader(file).get_summary()
    except DAMAGE as error:
        raise OutputError(f"{name}: reads back differently than it was written: {error}") from error
    if summary is None or summary.statistics is None:
        raise OutputError(f"{name}: reads back differently than it was written: it has no summary")
    channels, counts = [], summary.statistics.channel_message_counts
    for number, channel in sorted(summary.channels.items()):
        expected, got = copied.get(number) or added.get(number) or Tally(), found[number]
        # Chunks that cannot be checked are counted only in the file's index.
        indexed = got.messages if found.closed_chunks else counts.get(number, 0)
        if expected.as_json() != got.as_json() or indexed != got.messages:
            raise OutputError(
                f"{name}: {channel.topic} has {got.messages} messages (hash {got.hash}) after writing, "
                f"instead of {expected.messages} (hash {expected.hash}); {REMEDY}"
            )
        if number in added:
            channels.append({"topic": channel.topic, "added": got.as_json()})
        else:
            channels.append({"topic": channel.topic, "input": expected.as_json(), "output": got.as_json()})
    if set(found) - set(summary.channels):
        raise OutputError(f"{name}: has messages of channels that its summary does not list")
    _check_records(name, records, found.records, summary)
    return {
        "channels": channels,
        "chunks_not_looked_into": {"input": closed_chunks, "output": found.closed_chunks},
    }


def _check_records(name: str, expected: RecordTallies, found: RecordTallies, summary: Summary) -> None:
    """Raise an OutputError unless the records that are no messages are those that were written."""
    for kind, listed in (
        ("attachments", len(summary.attachment_indexes)),
        ("metadata records", len(summary.metadata_indexes)),
    ):
        if expected[kind] != found[kind] or listed != found[kind].messages:
            raise OutputError(
                f"{name}: has {found[kind].messages} {kind} after writing, {listed} in its index, instead of "
                f"{expected[kind].messages}; {REMEDY}"
            )
