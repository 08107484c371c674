"""The annotated MCAP held against its input: what is lost, changed or too much is found."""

from __future__ import annotations

import io
import json
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.records import Attachment
from mcap.writer import CompressionType, IndexType, Writer
from saved_maps import save_run

from rose2_logs.errors import OutputError
from rose2_logs.outputs.mcap import annotated as annotated_mcap
from rose2_logs.outputs.mcap.check import RecordTallies, Tallies, Tally, checked_copy
from rose2_logs.workflows.analyze import RunOptions, analyze_log

OFFICE = Path(__file__).parents[3] / "sample_logs" / "office.mcap"
TOPICS = ("/a", "/b", "/silent")
MESSAGES = [(k % 2, 10 * k, bytes([k]) * (k * 37)) for k in range(20)]


def mcap(messages=MESSAGES, compression=CompressionType.ZSTD, **options) -> bytes:
    """A file of messages (number of the topic, time, data)."""
    stream = io.BytesIO()
    writer = Writer(stream, chunk_size=2000, compression=compression, **options)
    writer.start("x", "y")
    schema = writer.register_schema("n", "jsonschema", b"{}")
    ids = [writer.register_channel(topic, "json", schema) for topic in TOPICS]
    for topic, time, data in messages:
        writer.add_message(ids[topic], time, data, time + 1, time)
    writer.finish()
    return stream.getvalue()


def tallies(data: bytes) -> Tallies:
    found = Tallies()
    found.take_file(io.BytesIO(data))
    return found


def plain(found: dict[int, Tally]) -> dict[int, dict]:
    return {channel: tally.as_json() for channel, tally in found.items()}


def test_the_same_messages_give_the_same_tallies_however_they_are_stored():
    """In any order, compressed or not, in chunks or not."""
    expected = tallies(mcap())
    assert {channel: tally.messages for channel, tally in expected.items()} == {1: 10, 2: 10}
    for data in (
        mcap(MESSAGES[::-1]),
        mcap(compression=CompressionType.LZ4),
        mcap(compression=CompressionType.NONE),
        mcap(use_chunking=False),
        mcap(index_types=IndexType.NONE),
    ):
        assert plain(tallies(data)) == plain(expected)


@pytest.mark.parametrize(
    "changed",
    [
        MESSAGES[:-1],
        [*MESSAGES, MESSAGES[3]],
        [*MESSAGES[:5], (1, 50, b"other"), *MESSAGES[6:]],
        [*MESSAGES[:5], (1, 51, MESSAGES[5][2]), *MESSAGES[6:]],
        [(1 - topic, time, data) for topic, time, data in MESSAGES],
    ],
    ids=["lost", "twice", "other data", "other time", "other channel"],
)
def test_another_file_is_refused(tmp_path: Path, changed):
    path = tmp_path / "copy.mcap"
    path.write_bytes(mcap(changed))
    with pytest.raises(OutputError, match=r"run\.mcap: /[ab] has \d+ messages .* after writing"):
        checked_copy(path, "run.mcap", tallies(mcap()), {}, 0, RecordTallies())


def test_what_is_equal_is_told_by_channel(tmp_path: Path):
    """Also of a channel without a message, and of channels that were added."""
    path = tmp_path / "copy.mcap"
    path.write_bytes(mcap())
    copied, added = {1: tallies(mcap())[1], 3: Tally()}, {2: tallies(mcap())[2]}
    told = checked_copy(path, "run.mcap", copied, added, 0, RecordTallies())
    by_topic = {each["topic"]: each for each in told["channels"]}
    assert by_topic["/a"]["input"] == by_topic["/a"]["output"] == plain(tallies(mcap()))[1]
    assert by_topic["/b"]["added"]["messages"] == 10
    assert by_topic["/silent"]["output"]["messages"] == 0


@pytest.mark.parametrize("cut", [9, 300, -200, -30, -1])
def test_a_file_that_is_cut_off_is_refused(tmp_path: Path, cut: int):
    path = tmp_path / "copy.mcap"
    path.write_bytes(mcap()[:cut])
    with pytest.raises(OutputError, match="reads back differently"):
        checked_copy(path, "run.mcap", tallies(mcap()), {}, 0, RecordTallies())


def test_a_chunk_that_is_damaged_is_not_looked_into():
    """None of its messages counts, those of the others do."""
    data = bytearray(mcap(compression=CompressionType.NONE))
    place = data.index(bytes([15]) * 37)
    data[place] ^= 1
    found = tallies(bytes(data))
    assert found.closed_chunks == 1
    assert 0 < sum(tally.messages for tally in found.values()) < 20


def test_the_summary_tells_what_was_copied(tmp_path: Path):
    """Numbers as another reader counts them in the log; the added ones are one a map."""

    options = RunOptions(recording=False, max_snapshots=2)
    analyze_log(OFFICE, tmp_path / "out", options)
    told = json.loads((tmp_path / "out" / "summary.json").read_text())["annotated_log"]
    with OFFICE.open("rb") as file:
        summary = make_reader(file).get_summary()
    counts = {c.topic: summary.statistics.channel_message_counts[n] for n, c in summary.channels.items()}
    assert {
        each["topic"]: each["output"]["messages"] for each in told["channels"] if "output" in each
    } == counts
    assert all(each["input"] == each["output"] for each in told["channels"] if "output" in each)
    added = {each["topic"]: each["added"]["messages"] for each in told["channels"] if "added" in each}
    assert added == dict.fromkeys(annotated_mcap.ADDED, 2)
    assert told["chunks_not_looked_into"] == {"input": 0, "output": 0}


def test_a_message_that_is_lost_on_the_way_is_an_error_and_no_file_appears(tmp_path: Path, monkeypatch):
    """A writer that drops one message."""
    dropped = []
    real = annotated_mcap.McapWriter.add_message

    def add_message(self, *message):
        if not dropped:
            dropped.append(message)
            return
        real(self, *message)

    monkeypatch.setattr(annotated_mcap.McapWriter, "add_message", add_message)
    maps = save_run(tmp_path / "maps")
    with pytest.raises(OutputError, match=r"maps\.rose2\.mcap: /map has 2 messages .*instead of 3 "):
        analyze_log(maps, tmp_path / "out", RunOptions(recording=False))
    assert len(dropped) == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("name", "kind"), [("add_attachment", "attachments"), ("add_metadata", "metadata")])
def test_a_record_that_is_lost_on_the_way_is_an_error_too(tmp_path: Path, monkeypatch, name: str, kind: str):
    """A writer that drops attachments, or metadata records."""
    monkeypatch.setattr(annotated_mcap.McapWriter, name, lambda self, *record: None)
    maps = save_run(tmp_path / "maps")
    with pytest.raises(OutputError, match=rf"maps\.rose2\.mcap: has 0 {kind} .*instead of [12]; "):
        analyze_log(maps, tmp_path / "out", RunOptions(recording=False))


@pytest.mark.parametrize("changed", [Attachment(1, 2, "a", "", b"y"), Attachment(1, 2, "b", "", b"x"), None])
def test_attachments_are_compared_with_what_was_written(tmp_path: Path, changed: Attachment | None):
    """In content, name, and in what the index of the file says of them."""
    path = tmp_path / "copy.mcap"
    with path.open("wb") as file:
        writer = Writer(file, index_types=IndexType.NONE if changed is None else IndexType.ALL)
        writer.start("x", "y")
        writer.add_attachment(1, 2, "a", "", b"x")
        writer.finish()
    expected = RecordTallies()
    expected.add(changed or Attachment(1, 2, "a", "", b"x"))
    with pytest.raises(OutputError, match=r"run\.mcap: has 1 attachments after writing, [01] in its index"):
        checked_copy(path, "run.mcap", {}, {}, 0, expected)
