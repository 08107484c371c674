"""The annotated MCAP, read back by other readers than ours."""

from __future__ import annotations

import dataclasses
import json
import subprocess
import sys
import tracemalloc
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.records import Attachment, Metadata
from mcap.writer import CompressionType, IndexType, Writer
from reader_logs import Update, serialized
from rosbags.highlevel import AnyReader
from saved_maps import save_run

from rose2_logs.errors import OutputError
from rose2_logs.io import open_log
from rose2_logs.outputs.mcap.annotated import ADDED, ATTACHMENT, METADATA, AnnotatedMcap
from rose2_logs.outputs.mcap.writer import McapWriter
from rose2_logs.runs.sink import RunInfo
from rose2_logs.runs.stream import TrackedStream, start_workers
from rose2_logs.workflows.analyze import RunOptions, analyze_log

PROJECT = Path(__file__).parents[3]
SHARED = PROJECT.parent / "shared" / "bags"
LOGS = {
    "sample mcap": PROJECT / "sample_logs" / "office.mcap",
    "sample bag": PROJECT / "sample_logs" / "wing.bag",
    "sample rosbag2": PROJECT / "sample_logs" / "ring",
    "ROS 1 bag": SHARED / "fr79.bag",
    "rosbag2 mcap": SHARED / "fr79.ros2_mcap",
    "rosbag2 sqlite3 zstd": SHARED / "fr79.ros2_sqlite3_zstd",
    "costmaps": SHARED / "third_party" / "base_cmaps_mcap",
}


PATCH = "map_msgs/msg/OccupancyGridUpdate"


def annotate(log: Path, folder: Path, **changes) -> Path:

    options = RunOptions(max_snapshots=3, recording=False, **changes)
    result = analyze_log(log, folder, options)
    (path,) = [file for file in result.files if file.suffix == ".mcap"]
    return path


def topic_of(name: str) -> str | None:
    return "/move_base/global_costmap/costmap" if name == "costmaps" else None


@pytest.fixture(scope="module", params=LOGS)
def annotated(request, tmp_path_factory):
    log = LOGS[request.param]
    if not log.exists():
        pytest.skip(f"{log.name} lies in the shared test data, which is absent")
    return log, annotate(log, tmp_path_factory.mktemp("out"), topic=topic_of(request.param))


def test_every_original_message_is_there_and_every_message_deserialises(annotated):
    log, path = annotated
    with AnyReader([log]) as before, AnyReader([path]) as after:
        originals = Counter((c.topic, time) for c, time, _ in before.messages())
        found = Counter()
        for connection, time, data in after.messages():
            after.deserialize(data, connection.msgtype)
            if connection.topic not in ADDED:
                found[connection.topic, time] += 1
        if before.is2:
            assert sorted(bytes(d) for c, _, d in after.messages() if c.topic not in ADDED) == sorted(
                bytes(d) for _, _, d in before.messages()
            )
    assert found == originals


def test_the_file_is_sound_in_log_time_order_and_of_the_ros2_profile(annotated):
    _, path = annotated
    doctor = subprocess.run(
        [Path(sys.executable).with_name("pymcap-cli"), "doctor", path],
        capture_output=True,
        text=True,
        check=False,
    )
    assert doctor.returncode == 0, doctor.stdout + doctor.stderr
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        assert "rose2_logs" in reader.get_header().library
        times = [message.log_time for _, _, message in reader.iter_messages(log_time_order=False)]
        assert times == sorted(times)
        assert METADATA in {record.name for record in reader.iter_metadata()}
        (parameters,) = [item for item in reader.iter_attachments() if item.name == ATTACHMENT]
        assert "floor_plan" in json.loads(parameters.data)


def test_the_added_topics_have_stamp_frame_and_latching_of_the_map(annotated):
    _, path = annotated
    with AnyReader([path]) as log:
        by_topic = {topic: [] for topic in ADDED}
        maps = {}
        for connection, time, data in log.messages():
            message = log.deserialize(data, connection.msgtype)
            if connection.topic in ADDED:
                by_topic[connection.topic].append((time, message))
            elif connection.msgtype == "nav_msgs/msg/OccupancyGrid":
                maps[time] = message
        for topic in ADDED:
            assert len(by_topic[topic]) in (1, 3)
        for time, rooms in by_topic["/rose2/rooms"]:
            assert rooms.header.frame_id == maps[time].header.frame_id
            assert rooms.header.stamp == maps[time].header.stamp
            assert 0 <= rooms.coverage <= 1
            tracks = [room.track for room in rooms.rooms]
            assert tracks == sorted(set(tracks))
            assert all(set(room.neighbors) <= set(tracks) for room in rooms.rooms)
        for time, grid in by_topic["/rose2/segmented_map"]:
            source = maps[time]
            assert (grid.info.width, grid.info.height) == (source.info.width, source.info.height)
            assert (np.asarray(grid.data)[np.asarray(source.data) < 0] == -1).all()
        for _, array in by_topic["/rose2/markers"]:
            assert array.markers[0].action == 3
            names = [(marker.ns, marker.id) for marker in array.markers[1:]]
            assert len(names) == len(set(names))
            assert all(len(marker.points) % 3 == 0 for marker in array.markers if marker.type == 11)


def test_of_saved_maps_each_map_is_written_as_a_message(tmp_path):
    path = annotate(save_run(tmp_path / "run"), tmp_path / "out")
    with AnyReader([path]) as log:
        count = Counter(connection.topic for connection, _, _ in log.messages())
    assert set(count) == {"/map", *ADDED}
    assert count["/map"] == count["/rose2/rooms"] == 3


def test_channels_of_other_encodings_attachments_and_empty_channels_are_kept(tmp_path):
    mixed = tmp_path / "mixed.mcap"
    with LOGS["sample mcap"].open("rb") as source, mixed.open("wb") as target:
        reader, writer = make_reader(source), Writer(target)
        writer.start("ros2", "test")
        schema = writer.register_schema("note", "jsonschema", b"{}")
        note = writer.register_channel("/note", "json", schema, {"by": "hand"})
        writer.register_channel("/silent", "json", schema)
        writer.add_attachment(1, 2, "a.txt", "text/plain", b"kept")
        writer.add_metadata("site", {"floor": "2"})
        channels = {}
        for kind, channel, message in reader.iter_messages(topics=["/map"]):
            if not channels:
                channels["/map"] = writer.register_channel(
                    "/map",
                    "cdr",
                    writer.register_schema(kind.name, kind.encoding, kind.data),
                    channel.metadata,
                )
            time = message.log_time
            writer.add_message(channels["/map"], time, message.data, time, 5)
            writer.add_message(note, time, b'{"text": "hello"}', time + 1, 9)
        writer.finish()
    path = annotate(mixed, tmp_path / "out")
    with path.open("rb") as file:
        reader = make_reader(file)
        topics = {channel.topic: channel for channel in reader.get_summary().channels.values()}
        assert topics["/note"].metadata == {"by": "hand"}
        assert "/silent" in topics
        notes = list(reader.iter_messages(topics=["/note"]))
        assert len(notes) == 40
        assert all(
            (m.publish_time, m.sequence, m.data) == (m.log_time + 1, 9, b'{"text": "hello"}')
            for _, _, m in notes
        )
        assert {item.name for item in reader.iter_attachments()} == {"a.txt", ATTACHMENT}
        assert {"site", METADATA} <= {record.name for record in reader.iter_metadata()}


def office_with_records(
    path: Path, *, number: int = 0, qos: str = "", without: IndexType = IndexType.NONE, chunks: bool = True
) -> Path:
    """Write the maps of the office after two attachments and two records, one each at the end."""
    with LOGS["sample mcap"].open("rb") as source, path.open("wb") as target:
        writer = Writer(target, use_chunking=chunks, index_types=IndexType.ALL & ~without)
        writer.start("ros2", "test")
        writer.add_attachment(1, 2, "a.yaml", "text/yaml", b"x: %d" % number)
        writer.add_metadata("robot", {"serial": str(number)})
        writer.add_metadata("rosbag2", {"ROS_DISTRO": "humble"})
        channel_id = None
        for kind, _, message in make_reader(source).iter_messages(topics=["/map"]):
            if channel_id is None:
                schema = writer.register_schema(kind.name, kind.encoding, kind.data)
                channel_id = writer.register_channel("/map", "cdr", schema, {"offered_qos_profiles": qos})
            time = message.log_time + number * 10**12
            writer.add_message(channel_id, time, message.data, time)
        writer.add_attachment(3, 4, "b.bin", "", bytes(1000))
        writer.add_metadata("end", {})
        writer.finish()
    return path


def records_of(path: Path) -> tuple[list[Attachment], list[Metadata]]:
    """What is neither a record of rosbag2 nor added, as another reader finds it by the index."""
    with path.open("rb") as file:
        reader = make_reader(file)
        attachments = [item for item in reader.iter_attachments() if item.name != ATTACHMENT]
        metadata = [each for each in reader.iter_metadata() if each.name not in (METADATA, "rosbag2")]
    return attachments, metadata


@pytest.mark.parametrize("form", ["no chunks", "not listed", "cut off"])
def test_attachments_and_metadata_are_kept_where_no_index_lists_them(tmp_path, form):
    log = office_with_records(
        tmp_path / "run.mcap",
        chunks=form != "no chunks",
        without=IndexType.ATTACHMENT | IndexType.METADATA if form == "not listed" else IndexType.NONE,
    )
    if form == "cut off":
        log.write_bytes(log.read_bytes()[:-40])
    path = annotate(log, tmp_path / "out")
    assert records_of(path) == records_of(office_with_records(tmp_path / "whole.mcap"))


def test_attachments_and_metadata_of_all_files_of_a_bag_are_kept(tmp_path):
    """But for what rosbag2 tells of each file; a quality of service that is not known stays so."""
    bag = tmp_path / "bag"
    bag.mkdir()
    files = [office_with_records(bag / f"bag_{number}.mcap", number=number, qos="[]") for number in range(2)]
    described = {
        "version": 5,
        "storage_identifier": "mcap",
        "relative_file_paths": [file.name for file in files],
        "duration": {"nanoseconds": 1},
        "starting_time": {"nanoseconds_since_epoch": 1},
        "message_count": 80,
        "topics_with_message_count": [],
        "compression_format": "",
        "compression_mode": "",
    }
    (bag / "metadata.yaml").write_text(json.dumps({"rosbag2_bagfile_information": described}))
    path = annotate(bag, tmp_path / "out")
    (attachments, metadata), (others, more) = map(records_of, files)
    assert records_of(path) == (attachments + others, metadata + more)
    with path.open("rb") as file:
        reader = make_reader(file)
        (version,) = [each.metadata for each in reader.iter_metadata() if each.name == "rosbag2"]
        channels = reader.get_summary().channels.values()
    assert "serialized_metadata" in version
    assert [each.metadata for each in channels if each.topic == "/map"] == [
        {"offered_qos_profiles": "[]"}
    ] * 2


def test_a_record_that_the_index_does_not_point_to_is_told(tmp_path, caplog):
    """Nothing else is taken for it."""
    log = office_with_records(tmp_path / "run.mcap")
    with log.open("rb") as file:
        listed = make_reader(file).get_summary().attachment_indexes[1].offset
    data = bytearray(log.read_bytes())
    data[listed] = 0x7F  # a kind of record that readers skip
    log.write_bytes(data)
    path = annotate(log, tmp_path / "out")
    assert [item.name for item in records_of(path)[0]] == ["a.yaml"]
    assert f"the attachment at byte {listed} is damaged" in caplog.text


def test_what_was_found_lies_at_the_height_of_the_map(tmp_path):
    """Also where a patch has changed the map; the layers are a little above it."""
    log, height_m = tmp_path / "run.mcap", 3.5
    with LOGS["sample mcap"].open("rb") as file:
        texts = {each.name: each.data for each in make_reader(file).get_summary().schemas.values()}
    with AnyReader([LOGS["sample mcap"]]) as source:
        (kept,) = (each for each in source.connections if each.topic == "/map")
        *_, (_, time, data) = source.messages([kept])
        message = source.deserialize(data, kept.msgtype)
        message.info.origin.position.z = height_m
        lifted = bytes(source.typestore.serialize_cdr(message, kept.msgtype))
    with log.open("wb") as target:
        writer = Writer(target)
        writer.start("ros2", "test")
        for topic, kind, content in (
            ("/map", kept.msgtype, lifted),
            ("/map_updates", PATCH, serialized(Update(3, 3, np.full((2, 2), 100)), 2)),
        ):
            schema = writer.register_schema(kind, "ros2msg", texts.get(kind, b""))
            channel = writer.register_channel(topic, "cdr", schema)
            writer.add_message(channel, time + (kind == PATCH), content, time)
        writer.finish()
    path = annotate(log, tmp_path / "out")
    heights = {topic: [] for topic in ADDED}
    with AnyReader([path]) as found:
        for connection, _, data in found.messages(
            [each for each in found.connections if each.topic in ADDED]
        ):
            message = found.deserialize(data, connection.msgtype)
            if connection.topic == "/rose2/markers":
                heights[connection.topic] += [each.pose.position.z for each in message.markers[1:]]
            elif connection.topic == "/rose2/rooms":
                heights[connection.topic] += [each.label_point.z for each in message.rooms]
                corners = [point for each in message.rooms for ring in each.outline for point in ring.points]
                assert {point.z for point in corners} == {height_m}
            else:
                heights[connection.topic].append(message.info.origin.position.z)
    markers = heights.pop("/rose2/markers")
    assert height_m < min(markers) <= max(markers) < height_m + 0.1
    assert all(set(each) == {height_m} and len(each) >= 2 for each in heights.values())
    layout = json.loads(path.with_suffix(".foxglove.json").read_text(encoding="utf-8"))
    assert layout["configById"]["3D!rooms"]["cameraState"]["targetOffset"][2] == height_m


def test_an_annotated_log_is_not_annotated_again_and_nothing_is_left_behind(tmp_path):
    once = annotate(save_run(tmp_path / "run"), tmp_path / "out")
    with pytest.raises(OutputError, match="already has /rose2/"):
        annotate(once, tmp_path / "again")
    assert not [file for file in (tmp_path / "again").rglob("*") if file.is_file()]


@dataclass(frozen=True)
class ChunkedLog:
    """A log of 20 chunks; the raw bytes of those without a map and of those with one."""

    path: Path
    without_map: list[bytes]
    with_map: list[bytes]


def chunked_log(
    path: Path,
    compression: CompressionType = CompressionType.ZSTD,
    maps_in: Sequence[int] = (5, 6, 18),
) -> ChunkedLog:
    """Write 20 chunks of two notes, the second so long that it ends the chunk, some with a map between."""
    with LOGS["sample mcap"].open("rb") as source, path.open("w+b") as target:
        kind, channel, first = next(make_reader(source).iter_messages(topics=["/map"]))
        cells = bytearray(first.data)
        writer = Writer(target, chunk_size=2 * len(cells), compression=compression)
        writer.start("ros2", "test")
        note = writer.register_channel("/note", "json", writer.register_schema("note", "jsonschema", b"{}"))
        schema = writer.register_schema(kind.name, kind.encoding, kind.data)
        grid = writer.register_channel("/map", "cdr", schema, channel.metadata)
        for number in range(20):
            time = 100 * (number + 1)
            writer.add_message(note, time, b"%d" % number, time, number)
            if number in maps_in:
                cells[-1 - number] = 100
                writer.add_message(grid, time + 50, bytes(cells), time + 50, number)
            writer.add_message(note, time + 90, b" " * (2 * len(cells)), time + 90, number)
        writer.finish()
        raw = []
        target.seek(0)
        for chunk in make_reader(target).get_summary().chunk_indexes:
            target.seek(chunk.chunk_start_offset)
            raw.append(target.read(chunk.chunk_length))
    return ChunkedLog(
        path,
        [chunk for number, chunk in enumerate(raw) if number not in maps_in],
        [raw[number] for number in maps_in],
    )


def raw_messages(path: Path) -> list[tuple]:
    """Every message outside the added topics, in the order of the file, checksums verified."""
    with path.open("rb") as file:
        return [
            (c.topic, m.log_time, m.publish_time, m.sequence, m.data)
            for _, c, m in make_reader(file, validate_crcs=True).iter_messages(log_time_order=False)
            if c.topic not in ADDED
        ]


@pytest.mark.parametrize("compression", CompressionType)
def test_chunks_without_a_map_are_copied_as_they_are(tmp_path, compression):
    """Compressed as they were; the others are written again, so that what was found stands by log time."""
    log = chunked_log(tmp_path / "run.mcap", compression)
    path = annotate(log.path, tmp_path / "out")
    written = path.read_bytes()
    assert all(written.count(chunk) == 1 for chunk in log.without_map)
    assert not any(chunk in written for chunk in log.with_map)
    assert raw_messages(path) == raw_messages(log.path)
    with path.open("rb") as file:
        reader = make_reader(file)
        times = [message.log_time for _, _, message in reader.iter_messages(log_time_order=False)]
        assert times == sorted(times)
        summary = reader.get_summary()
        counts = Counter(c.topic for _, c, _ in reader.iter_messages())
        assert counts == {"/note": 40, "/map": 3, **dict.fromkeys(ADDED, 3)}
        told = {
            summary.channels[each].topic: n for each, n in summary.statistics.channel_message_counts.items()
        }
        assert told == counts
        assert summary.statistics.message_count == sum(counts.values())
        span = (summary.statistics.message_start_time, summary.statistics.message_end_time)
        assert span == (times[0], times[-1])


def test_channels_keep_their_ids_zero_too(tmp_path):
    """Some writers count channels from 0; chunks that are copied as they are name them so."""
    log = chunked_log(tmp_path / "run.mcap")
    from_zero = tmp_path / "from_zero.mcap"
    with log.path.open("rb") as source, from_zero.open("wb") as target:
        writer, known = McapWriter(target, "ros2", "test"), set()
        for schema, channel, message in make_reader(source).iter_messages():
            number = channel.id - 1
            if number not in known:
                known.add(number)
                kind = writer.register_schema(schema.name, schema.encoding, schema.data)
                assert number == writer.register_channel(
                    channel.topic, channel.message_encoding, kind, channel.metadata, number
                )
            writer.add_message(number, message.log_time, message.data, message.publish_time, message.sequence)
            writer.flush()
        writer.finish()
    path = annotate(from_zero, tmp_path / "out")
    assert raw_messages(path) == raw_messages(from_zero)
    with path.open("rb") as file:
        channels = make_reader(file).get_summary().channels
    assert [channels[number].topic for number in (0, 1)] == ["/note", "/map"]


def test_what_stopped_the_writing_is_told_not_what_closing_meets(tmp_path):
    """With the greatest size of a file set low, as on a full disk: closing fails once more."""
    log = LOGS["sample mcap"]
    script = f"""
import resource, signal
from pathlib import Path
from rose2_logs.errors import OutputError
from rose2_logs.config.parameters import Parameters
from rose2_logs.outputs.mcap.annotated import AnnotatedMcap
from rose2_logs.runs.sink import RunInfo, abandoned_on_error
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (2_000, 2_000))
info = RunInfo(Path({str(log)!r}), "/map", "rose2", Parameters(), {{}}, {{}})
sink = AnnotatedMcap(Path({str(tmp_path / "run.mcap")!r}))
try:
    with abandoned_on_error([sink]):
        sink.begin(info)
        sink.finish(None)
except OutputError as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert "run.mcap: cannot be written" in done.stdout
    assert not list(tmp_path.iterdir())


def test_a_damaged_chunk_stays_as_it_is(tmp_path):
    """What nothing is added to is not looked into: nothing is lost that a repair could bring back."""
    log = chunked_log(tmp_path / "run.mcap")
    damaged = bytearray(log.without_map[3])
    damaged[-20] ^= 0xFF
    log.path.write_bytes(log.path.read_bytes().replace(log.without_map[3], bytes(damaged)))
    path = annotate(log.path, tmp_path / "out")
    assert bytes(damaged) in path.read_bytes()


def test_nothing_is_kept_of_chunks_that_were_taken_apart(tmp_path):
    """Memory does not grow with the log: in the second ten maps it is at most what it was in the first.

    It goes up and down, as a chunk of what is added is filled and written.
    """
    log = chunked_log(tmp_path / "run.mcap", maps_in=range(20))
    options = RunOptions()
    with open_log(log.path) as reader, start_workers(options) as workers:
        step = next(iter(TrackedStream.of_log(reader, workers, options.parameters)))
        times = [snapshot.log_time_ns for snapshot in reader.snapshots()]
    info = RunInfo(log.path, "/map", "rose2", options.parameters, {}, {})
    held = []
    tracemalloc.start()
    try:
        sink = AnnotatedMcap(tmp_path / "out.mcap")
        sink.begin(info)
        for time in times:
            snapshot = dataclasses.replace(step.snapshot, log_time_ns=time)
            sink.write(dataclasses.replace(step, snapshot=snapshot))
            held.append(tracemalloc.get_traced_memory()[0])
        sink.abandon()
    finally:
        tracemalloc.stop()
    assert max(held[10:]) - max(held[:10]) < step.snapshot.cells.nbytes


def test_a_log_without_an_index_is_copied_message_by_message(tmp_path):
    """As one is that was cut off: what is whole goes over, with an index this time."""
    log = chunked_log(tmp_path / "run.mcap")
    cut = log.path.read_bytes()
    cut = cut[: cut.index(log.with_map[-1]) + len(log.with_map[-1]) + 5]
    log.path.write_bytes(cut)
    path = annotate(log.path, tmp_path / "out")
    whole = chunked_log(tmp_path / "whole.mcap")
    assert raw_messages(path) == raw_messages(whole.path)[: 19 * 2 + 3]
