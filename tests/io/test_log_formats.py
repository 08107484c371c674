"""Every format of a log gives the same maps; damaged, foreign and mapless logs end well."""

import contextlib
import errno
import itertools
import logging
import shutil
import sqlite3
import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from foxglove_grids import SCHEMA, foxglove_message
from mcap.writer import CompressionType, IndexType
from reader_logs import (
    SHARED,
    START_NS,
    Map,
    McapLog,
    Text,
    Update,
    growing_maps,
    run_of_maps,
    serialized,
    serialized_costmap,
    write_bag,
    write_mcap,
    write_rosbag2,
)
from saved_maps import save_run
from scipy.ndimage import binary_dilation

import rose2_logs as rl
from rose2_logs.config.reading import ReadingParameters
from rose2_logs.config.selection import Selection
from rose2_logs.errors import InvalidMapError, LogError, NoMapTopicError
from rose2_logs.io import inspect_log, open_log
from rose2_logs.system.warnings import StrictError, collect_warnings

needs_shared = pytest.mark.skipif(
    not SHARED.is_dir(), reason="the folder of real logs is not beside the project"
)


def read(path, **options):
    with open_log(path, **options) as log:
        return list(log.snapshots())


def assert_are(snapshots, maps, times=None):
    """The snapshots must be these maps, cell by cell, with their stamps, frames, origins, yaws and times."""
    assert [each.index for each in snapshots] == list(range(len(maps)))
    for k, (got, expected) in enumerate(zip(snapshots, maps, strict=True)):
        np.testing.assert_array_equal(got.cells, expected.cells)
        assert got.cells.dtype == np.int8
        assert got.cells.flags.c_contiguous
        assert not got.cells.flags.writeable
        assert got.geometry.origin_xy_m == expected.origin
        assert got.geometry.frame_id == expected.frame
        assert got.geometry.resolution_m == expected.resolution
        assert got.geometry.yaw_rad == pytest.approx(expected.yaw)
        assert got.stamp_ns == expected.stamp_ns
        assert got.log_time_ns == (START_NS + k * 10**10 if times is None else times[k])


MCAP_OPTIONS = {
    "zstd": {},
    "lz4": {"compression": CompressionType.LZ4},
    "uncompressed": {"compression": CompressionType.NONE},
    "one-chunk": {"chunk_size": 10**7},
    "unchunked": {"use_chunking": False},
    "no-index": {"index_types": IndexType.NONE},
    "no-message-index": {"index_types": IndexType.CHUNK},
    "no-statistics": {"use_statistics": False},
    "no-repeated-channels": {"repeat_channels": False},
    "no-repeated-schemas": {"repeat_schemas": False},
    "no-summary": {
        "index_types": IndexType.NONE,
        "repeat_channels": False,
        "repeat_schemas": False,
        "use_statistics": False,
        "use_summary_offsets": False,
    },
    "no-crc": {"enable_crcs": False},
}
FORMATS = {
    "bag": lambda path, log: write_bag(path / "run.bag", log),
    "bag-lz4": lambda path, log: write_bag(path / "run.bag", log, "LZ4"),
    "bag-bz2": lambda path, log: write_bag(path / "run.bag", log, "BZ2"),
    "mcap-ros1": lambda path, log: write_mcap(path / "run.mcap", log, ros=1),
    **{
        f"mcap-{name}": lambda path, log, options=options: write_mcap(path / "run.mcap", log, **options)
        for name, options in MCAP_OPTIONS.items()
    },
    **{
        f"rosbag2-{storage}-{mode}".lower(): lambda path, log, storage=storage, mode=mode: write_rosbag2(
            path / "run", log, storage, mode
        )
        for storage in ("SQLITE3", "MCAP")
        for mode in ("NONE", "FILE", "MESSAGE")
    },
    "rosbag2-mcap-storage": lambda path, log: write_rosbag2(path / "run", log, "MCAP", "STORAGE"),
    "db3": lambda path, log: write_rosbag2(path / "run", log) / "run.db3",
}


CLOSED = {
    **{name: FORMATS[name] for name in ("bag", "mcap-zstd", "mcap-no-index", "rosbag2-sqlite3-none", "db3")},
    "packed": FORMATS["rosbag2-mcap-file"],
    "saved maps": lambda path, log: save_run(path / "maps"),
}


@pytest.mark.parametrize("name", CLOSED)
def test_a_closed_log_is_no_damaged_one(name, tmp_path, caplog):
    """It is told in one line, also where it was closed on the way, and nothing is taken for damage."""
    path = CLOSED[name](tmp_path, run_of_maps())
    with open_log(path) as log:
        begun = log.snapshots()
        next(begun)
    with open_log(path) as never_read:
        pass
    calls = [begun, never_read.snapshots(), log.snapshots()]
    readings = [partial(next, each) for each in calls] + [
        never_read.first,
        never_read.last,
        never_read.lasts,
        lambda: never_read.robot_path("map"),
        lambda: never_read.part_count,
    ]
    for reading in readings:
        with pytest.raises(LogError) as error:
            reading()
        assert str(error.value) == f"{path}: the log is closed; read its maps before it is, inside of `with`"
    assert not caplog.records


def test_rooms_are_not_tracked_in_a_closed_log(tmp_path):
    with open_log(write_mcap(tmp_path / "run.mcap", run_of_maps())) as log:
        steps = rl.track(log)
    with pytest.raises(LogError, match="the log is closed"):
        next(steps)


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_gives_the_same_maps_and_the_same_description(name, tmp_path):
    path = FORMATS[name](tmp_path, run_of_maps())
    with open_log(path) as log:
        assert_are(list(log.snapshots()), growing_maps())
        assert log.counts.messages == 6
        assert (log.first().index, log.last().index) == (0, -1)
        assert_are([log.first()], growing_maps()[:1])
        np.testing.assert_array_equal(log.last().cells, growing_maps()[-1].cells)
        assert log.last().log_time_ns == START_NS + 5 * 10**10
    info = inspect_log(path)
    assert info == log.info
    assert (info.start_ns, info.end_ns) == (START_NS, START_NS + 5 * 10**10 + 10**9)
    assert info.duration_s == 51
    assert [(topic.name, topic.message_count, topic.is_map) for topic in info.topics] == [
        ("/chatter", 6, False),
        ("/map", 6, True),
    ]
    ros1 = ("bag-" in name + "-" and "rosbag2" not in name) or name == "mcap-ros1"
    assert info.topics[1].encoding == ("ros1" if ros1 else "cdr")
    assert info.topics[1].message_type == ("nav_msgs/OccupancyGrid" if ros1 else "nav_msgs/msg/OccupancyGrid")
    files = [path] if path.is_file() else list(path.iterdir())
    assert info.size_bytes == sum(file.stat().st_size for file in files)


@pytest.mark.parametrize("name", ["bag", "mcap-zstd", "rosbag2-sqlite3-none"])
def test_a_rotated_and_moving_map_keeps_its_place(name, tmp_path):
    maps = [
        Map(np.full((4, 5), k, np.int8), origin=(k * 0.5, -k), yaw=k - 1.5, resolution=0.1 / (k + 1))
        for k in range(3)
    ]
    path = FORMATS[name](tmp_path, [("/map", START_NS + k * 10**10, each) for k, each in enumerate(maps)])
    snapshots = read(path)
    assert [each.geometry.yaw_rad for each in snapshots] == pytest.approx([-1.5, -0.5, 0.5])
    assert [each.geometry.origin_xy_m for each in snapshots] == [(0.0, 0.0), (0.5, -1.0), (1.0, -2.0)]
    assert [each.geometry.resolution_m for each in snapshots] == pytest.approx([0.1, 0.05, 0.1 / 3])


IN_ANY_ORDER = ["mcap-one-chunk", "mcap-unchunked", "mcap-zstd", "bag", "db3"]


@pytest.mark.parametrize("name", IN_ANY_ORDER)
def test_maps_written_out_of_order_by_less_than_a_second_come_in_the_order_of_log_time(name, tmp_path):
    maps = growing_maps()
    times = [START_NS + k * 10**8 for k in range(6)]
    log = [("/map", time, each) for time, each in zip(times, maps, strict=True)]
    shuffled = [log[k] for k in (3, 1, 0, 5, 2, 4)]
    assert_are(read(FORMATS[name](tmp_path, shuffled)), maps, times)


@pytest.mark.parametrize("name", IN_ANY_ORDER)
def test_maps_behind_a_clock_that_was_set_back_come_in_the_order_of_the_file(name, tmp_path, caplog):
    maps = growing_maps()
    times = [START_NS + seconds * 10**9 for seconds in (0, 10, 20, -100, -90, -80)]
    log = [("/map", time, each) for time, each in zip(times, maps, strict=True)]
    goes_on = [START_NS + k * 10**10 for k in range(6)]
    assert_are(read(FORMATS[name](tmp_path, log)), maps, goes_on)
    assert "goes back by 120.0 s at message 4 of the file" in caplog.text


@pytest.mark.parametrize("kind", ["bags", "ROS 2 bag", "databases"])
def test_files_behind_a_clock_that_was_set_back_come_in_their_order(kind, tmp_path, caplog):
    maps = growing_maps()
    times = [START_NS + seconds * 10**9 for seconds in (0, 10, -100, -90, -80, -300)]
    log = [("/map", time, each) for time, each in zip(times, maps, strict=True)]
    folder = tmp_path / "run"
    folder.mkdir()
    paths = []
    for number, part in enumerate((log[:2], log[2:5], log[5:])):
        match kind:
            case "bags":
                paths.append(write_bag(folder / f"run_{number}.bag", part))
            case "ROS 2 bag":
                paths.append(write_mcap(folder / f"run_{number}.mcap", part))
            case _:
                written = write_rosbag2(tmp_path / f"bag{number}", part)
                paths.append(next(written.glob("*.db3")).rename(folder / f"run_{number}.db3"))
    goes_on = [START_NS + k * 10**10 for k in range(6)]
    assert_are(read(folder if kind == "ROS 2 bag" else paths), maps, goes_on)
    assert f"goes back by 110.0 s from {paths[0].name} to this file" in caplog.text
    assert f"goes back by 220.0 s from {paths[1].name} to this file" in caplog.text


@pytest.mark.parametrize("name", IN_ANY_ORDER)
def test_maps_before_a_clock_was_set_to_the_right_year_are_moved_up_to_it(name, tmp_path, caplog):
    maps = growing_maps()
    times = [0, 10**10, *(START_NS + k * 10**10 for k in range(2, 6))]
    log = [("/map", time, each) for time, each in zip(times, maps, strict=True)]
    path = FORMATS[name](tmp_path, log)
    assert_are(read(path), maps, [START_NS + k * 10**10 for k in range(6)])
    assert "goes forward by 53.9 years at message 3" in caplog.text
    assert "are 53.9 years apart" in caplog.text
    assert inspect_log(path).duration_s == 50.0


@pytest.mark.parametrize(
    ("name", "language", "encoding"),
    [
        ("nav_msgs/msg/OccupancyGrid", "ros2msg", "cbor"),
        ("nav_msgs.OccupancyGrid", "protobuf", "protobuf"),
        ("foxglove.Grid", "flatbuffer", "msgpack"),
    ],
)
def test_maps_that_cannot_be_read_are_named_with_their_encoding(name, language, encoding, tmp_path):
    log = McapLog(tmp_path / "run.mcap")
    log.raw("/grid", START_NS, (name, language, b""), encoding, b"\x00")
    with pytest.raises(NoMapTopicError) as refused:
        open_log(log.close())
    text = str(refused.value)
    assert f"/grid holds {name} in the encoding {encoding}, defined in {language}, which is not read" in text
    assert "convert" in text
    assert "\n" not in text


def test_channels_of_other_encodings_beside_the_map_do_no_harm(tmp_path):
    log = McapLog(tmp_path / "mixed.mcap")
    log.raw("/pose", START_NS - 5, ("foxglove.Pose", "protobuf", SCHEMA), "protobuf", b"\x0a\x00")
    log.raw("/status", START_NS - 4, ("Status", "jsonschema", b"{}"), "json", b'{"ok": true}')
    log.raw("/binary", START_NS - 3, ("Blob", "flatbuffer", bytes(range(256))), "flatbuffer", b"\xff\xfe")
    for topic, time, message in run_of_maps():
        log.add(topic, time, message, ros=1 if topic == "/chatter" else 2)
    path = log.close()
    assert_are(read(path), growing_maps())
    assert {topic.name: topic.encoding for topic in inspect_log(path).topics} == {
        "/binary": "flatbuffer", "/chatter": "ros1", "/map": "cdr", "/pose": "protobuf", "/status": "json",
    }  # fmt: skip


def test_a_ros2_bag_directory_may_hold_foreign_channels_too(tmp_path):
    bag = write_rosbag2(tmp_path / "run", run_of_maps(), "MCAP")
    log = McapLog(bag / "run.mcap")
    log.raw("/status", START_NS, ("Status", "jsonschema", b"{}"), "json", b"{}")
    for topic, time, message in run_of_maps():
        log.add(topic, time, message)
    log.close()
    assert_are(read(bag), growing_maps())


def test_foxglove_grids_and_nav2_costmaps_in_mcap_are_maps(tmp_path):
    log = McapLog(tmp_path / "run.mcap")
    schema = ("foxglove.Grid", "protobuf", SCHEMA)
    grid = foxglove_message(np.array([[0, 100], [255, 7]], np.uint8), 1).SerializeToString()
    log.raw("/map", START_NS, schema, "protobuf", grid)
    costs = serialized_costmap(np.array([[0, 254], [255, 1]], np.uint8))
    log.raw("/costmap_raw", START_NS, ("nav2_msgs/msg/Costmap", "ros2msg", b""), "cdr", costs)
    path = log.close()
    assert read(path)[0].cells.tolist() == [[0, 100], [-1, 7]]
    assert read(path, topic="/costmap_raw")[0].cells.tolist() == [[0, 100], [-1, 1]]


@pytest.mark.parametrize("index", [IndexType.ALL, IndexType.NONE])
def test_messages_with_times_that_no_clock_shows_are_left_out_and_counted(index, tmp_path):
    log = McapLog(tmp_path / "run.mcap", index_types=index)
    for time in (START_NS, 2**63 + 5, 2**64 - 1):
        log.add("/map", time, Map(np.zeros((4, 6), np.int8)))
    with collect_warnings() as warnings:
        snapshots = read(log.close())
    assert [each.log_time_ns for each in snapshots] == [START_NS]
    assert warnings.kinds


def test_messages_of_a_database_from_before_1970_are_left_out_and_told(tmp_path):
    maps = [("/map", START_NS + k * 10**10, Map(np.full((4, 6), k, np.int8))) for k in range(4)]
    path = next(write_rosbag2(tmp_path / "run", maps).glob("*.db3"))
    with sqlite3.connect(path) as base:
        base.execute("update messages set timestamp = timestamp - ?", (START_NS + 15 * 10**9,))
    with collect_warnings() as warnings:
        snapshots = read(path)
    assert [each.log_time_ns for each in snapshots] == [5 * 10**9, 15 * 10**9]
    assert list(warnings.kinds) == ["damaged_message"]


def cut(path: Path, share: float) -> Path:
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * share)])
    return path


@pytest.mark.parametrize("name", ["mcap-zstd", "mcap-uncompressed", "mcap-unchunked", "mcap-ros1"])
@pytest.mark.parametrize("share", [0.999, 0.6, 0.3])
def test_a_cut_off_mcap_gives_the_maps_that_are_whole_and_says_so(name, share, tmp_path, caplog):
    # Large enough maps that the cut lies among them, not in the summary.
    maps = [
        Map(np.random.default_rng(k).integers(-1, 101, (60, 80)), stamp_ns=START_NS + k) for k in range(8)
    ]
    log = [("/map", START_NS + k * 10**10, each) for k, each in enumerate(maps)]
    path = cut(FORMATS[name](tmp_path, log), share)
    snapshots = read(path)
    assert 1 <= len(snapshots) <= 8
    assert share < 0.99 or len(snapshots) == 8
    assert_are(snapshots, maps[: len(snapshots)])
    assert not inspect_log(path).indexed
    # A cut in the summary costs nothing but the index.
    assert (len(snapshots) == 8) or f"{path}: truncated" in caplog.text


def flip(path: Path, at: int) -> None:
    data = bytearray(path.read_bytes())
    data[at] ^= 0xFF
    path.write_bytes(data)


def noisy_run() -> tuple[list[Map], list]:
    """Maps that do not compress, so that a place in the file is a place in a map."""
    maps = [
        Map(np.random.default_rng(k).integers(-1, 101, (60, 80)), stamp_ns=START_NS + k) for k in range(5)
    ]
    return maps, [("/map", START_NS + k * 10**10, each) for k, each in enumerate(maps)]


@pytest.mark.parametrize(
    # The other formats carry no checksum that would tell.
    "name",
    ["mcap-zstd", "mcap-lz4", "mcap-uncompressed", "bag-bz2"],
)
def test_a_flipped_byte_costs_the_maps_around_it_and_is_counted(name, tmp_path, caplog):
    maps, messages = noisy_run()
    path = FORMATS[name](tmp_path, messages)
    file = path if path.is_file() else path / "run.db3"
    data = file.read_bytes()
    at = len(data) // 2
    if name == "mcap-uncompressed":
        at = data.index(serialized(maps[2], 2)[-2000:-1000])
    flip(file, at)
    with open_log(path) as log:
        snapshots = list(log.snapshots())
        assert log.counts.damaged == 1
        assert log.counts.messages == 5 == len(snapshots) + log.counts.damaged
        np.testing.assert_array_equal(log.last().cells, maps[-1].cells)
    whole = {each.cells.tobytes() for each in snapshots}
    assert whole <= {each.cells.astype(np.int8).tobytes() for each in maps}
    assert "damaged" in caplog.text
    assert "/map" in caplog.text


def test_without_index_a_damaged_chunk_is_left_out_and_said(tmp_path, caplog):
    _maps, messages = noisy_run()
    path = FORMATS["mcap-no-summary"](tmp_path, messages)
    flip(path, path.stat().st_size // 2)
    assert len(read(path)) == 4
    assert "is damaged (its checksum is wrong)" in caplog.text


def test_when_all_maps_are_damaged_the_reading_fails_and_says_so(tmp_path):
    _, messages = noisy_run()
    path = FORMATS["mcap-zstd"](tmp_path, messages[:1])
    flip(path, path.stat().st_size // 2)
    with open_log(path) as log:
        for reading in (lambda: list(log.snapshots()), log.first, log.last):
            with pytest.raises(LogError, match="1 messages are damaged"):
                reading()


def test_the_last_map_and_a_time_range_are_reached_past_damage_that_is_never_read(tmp_path, caplog):
    maps, messages = noisy_run()
    path = FORMATS["mcap-uncompressed"](tmp_path, messages)
    data = path.read_bytes()
    for each in maps[1:3]:
        flip(path, data.index(serialized(each, 2)[-2000:-1000]))
    selection = Selection(start_ns=START_NS + 3 * 10**10)
    with open_log(path, selection=selection) as log:
        assert_are(list(log.snapshots()), maps[3:], [START_NS + 3 * 10**10, START_NS + 4 * 10**10])
    with open_log(path, selection=Selection(max_snapshots=2)) as log:
        assert_are(list(log.snapshots()), [maps[0], maps[4]], [START_NS, START_NS + 4 * 10**10])
        assert log.counts.skipped == 3
        log.first()
        log.last()
    assert caplog.text == "", "the damaged maps were read"


@pytest.mark.parametrize("name", ["bag", "mcap-zstd", "rosbag2-sqlite3-none"])
def test_an_invalid_map_is_left_out_and_told_or_an_error_where_that_is_asked_for(name, tmp_path):
    log = [
        ("/map", START_NS, growing_maps(1)[0]),
        ("/map", START_NS + 1, Map(np.zeros((2, 2)), resolution=-1)),
    ]
    path = FORMATS[name](tmp_path, log)
    with collect_warnings() as warning_log, open_log(path) as reader:
        assert_are(list(reader.snapshots()), growing_maps(1))
        assert (reader.counts.messages, reader.counts.invalid) == (2, 1)
    (told,) = warning_log.kinds["invalid_map"].first
    assert f"{path}: message 2 of 2 on /map: the map's resolution is -1" in told["message"]
    assert "\n" not in told["message"]
    assert (told["topic"], told["index"]) == ("/map", 2)
    with collect_warnings(strict=True), open_log(path) as reader, pytest.raises(StrictError) as caught:
        list(reader.snapshots())
    assert told["message"] in str(caught.value)


def test_several_files_are_read_as_one_log(tmp_path):
    log = run_of_maps()
    halves = [log[:6], log[6:]]
    for suffix, write in ((".mcap", write_mcap), (".bag", write_bag)):
        files = [write(tmp_path / f"part{k}{suffix}", half) for k, half in enumerate(halves)]
        # The order of the files is not that of time.
        assert_are(read(files[::-1]), growing_maps())
        assert_are(read(str(tmp_path / f"part*{suffix}")), growing_maps())
        assert inspect_log(files).topics[1].message_count == 6
    files = [
        shutil.copy(write_rosbag2(tmp_path / f"bag{k}", half) / f"bag{k}.db3", tmp_path)
        for k, half in enumerate(halves)
    ]
    assert_are(read(files), growing_maps())
    with pytest.raises(LogError, match="different kinds"):
        open_log([tmp_path / "part0.mcap", tmp_path / "part1.bag"])


def test_compressed_files_of_one_name_from_several_folders_are_several_files(tmp_path):
    log = run_of_maps()
    files = []
    for k, half in enumerate((log[:6], log[6:])):
        bag = write_rosbag2(tmp_path / str(k) / "run", half, compression="FILE")
        files.append(bag / "run.db3.zstd")
    assert_are(read(files), growing_maps())


def test_each_chunk_of_a_bag_written_topic_by_topic_is_decompressed_once(tmp_path, monkeypatch):
    """Its chunks overlap in time throughout; as many decompressions as messages take hours for a long bag."""
    from rose2_logs.io.rosbag1 import index as bag_index

    bag = write_bag(tmp_path / "run.bag", written_topic_by_topic(), compression="LZ4", chunk_bytes=2**14)
    begins = []
    chunk_data = bag_index.chunk_data

    def counted(stream, head, most_bytes):
        begins.append(head.begin)
        return chunk_data(stream, head, most_bytes)

    monkeypatch.setattr(bag_index, "chunk_data", counted)
    file = bag_index.BagFile(bag, ReadingParameters())
    with contextlib.closing(file):
        times = [message.log_time_ns for message in file.messages()]
    assert times == sorted(times)
    assert len(times) == 80
    assert 4 <= len(begins) == len(set(begins)) < 20


def test_no_more_chunks_of_a_bag_are_kept_than_their_size_allows():
    """The latest always is; the one that was not asked for the longest goes first."""
    from rose2_logs.io.rosbag1.index import _Chunks

    read = []

    def chunk(begin):
        read.append(begin)
        return bytes(begin)

    chunks = _Chunks(chunk, 10)
    for begin in (4, 5, 4, 6, 4, 5, 20, 20, 4):
        assert len(chunks.records(begin)) == begin
    assert read == [4, 5, 6, 5, 20, 4]
    one = _Chunks(chunk, 0)
    read.clear()
    for begin in (4, 4, 5, 4):
        one.records(begin)
    assert read == [4, 5, 4]


def written_topic_by_topic():
    """Two topics of texts of a kilobyte whose times interlace, one topic after the other."""
    return [
        (topic, START_NS + k * 10**9 + late, Text(f"{topic}{k}" * 200))
        for topic, late in (("/one", 0), ("/two", 10**8))
        for k in range(40)
    ]


@pytest.mark.parametrize("storage", ["SQLITE3", "MCAP"])
def test_a_split_ros2_bag_is_read_through_all_its_files(storage, tmp_path):
    log = run_of_maps()
    bag = write_rosbag2(tmp_path / "run", log[:6], storage)
    second = write_rosbag2(tmp_path / "second", log[6:], storage)
    suffix = "db3" if storage == "SQLITE3" else "mcap"
    shutil.move(second / f"second.{suffix}", bag / f"run_1.{suffix}")
    metadata = (bag / "metadata.yaml").read_text()
    entry = f"- run.{suffix}\n"
    indent = metadata[: metadata.index(entry)].rsplit("\n", 1)[1]
    (bag / "metadata.yaml").write_text(metadata.replace(entry, f"{entry}{indent}- run_1.{suffix}\n", 1))
    assert_are(read(bag), growing_maps())
    (bag / f"run_1.{suffix}").unlink()
    with collect_warnings() as warning_log:
        assert_are(read(bag), growing_maps()[:3])
    assert f"run_1.{suffix}: is missing" in warning_log.kinds["file_missing"].first[0]["message"]
    with collect_warnings(strict=True), pytest.raises(StrictError, match=f"run_1.{suffix}"):
        open_log(bag)
    (bag / f"run.{suffix}").unlink()
    with pytest.raises(LogError, match=f"run.{suffix}"):
        open_log(bag)


@pytest.mark.parametrize("storage", ["SQLITE3", "MCAP"])
def test_a_ros2_bag_whose_recorder_died_before_writing_metadata_is_read_all_the_same(storage, tmp_path):
    bag = write_rosbag2(tmp_path / "run", run_of_maps(), storage)
    (bag / "metadata.yaml").unlink()
    assert_are(read(bag), growing_maps())


def test_a_folder_of_several_logs_is_not_taken_for_one_without_a_word(tmp_path):
    """As a bag without its description they may be one; unlike one, they are likely several."""
    log = run_of_maps()
    (tmp_path / "run").mkdir()
    one = write_mcap(tmp_path / "run" / "run_0.mcap", log[:6])
    two = write_mcap(tmp_path / "run" / "run_1.mcap", log[6:])
    with collect_warnings() as warning_log:
        assert_are(read(one.parent), growing_maps())
    assert not warning_log.kinds
    two.rename(two.with_name("another.mcap"))
    with collect_warnings() as warning_log:
        assert_are(read(one.parent), growing_maps())
    assert "2 files from another.mcap on" in warning_log.kinds["files_as_one"].first[0]["message"]
    write_bag(one.with_name("third.bag"), log)
    (one.parent / "another.mcap").unlink()
    with collect_warnings() as warning_log:
        assert_are(read(one.parent), growing_maps()[:3])
    assert (
        "run_0.mcap is read as one log, third.bag ignored"
        in (warning_log.kinds["files_as_one"].first[0]["message"])
    )


def test_bags_below_a_log_are_not_ignored_without_a_word(tmp_path):
    log = run_of_maps()
    (tmp_path / "runs").mkdir()
    write_mcap(tmp_path / "runs" / "monday.mcap", log)
    for day in ("friday", "tuesday"):
        write_rosbag2(tmp_path / "runs" / day, log, "MCAP")
    with collect_warnings() as warning_log:
        assert_are(read(tmp_path / "runs"), growing_maps())
    told = warning_log.kinds["files_as_one"].first[0]["message"]
    assert "monday.mcap is read as one log, friday/, tuesday/ ignored" in told
    assert told.endswith("or analyze the folder as a batch")


def test_an_annotated_copy_beside_a_log_is_no_part_of_it(tmp_path):
    log = run_of_maps()
    (tmp_path / "run").mkdir()
    write_mcap(tmp_path / "run" / "run_0.mcap", log[:6])
    write_mcap(tmp_path / "run" / "run_0.rose2.mcap", log)
    with collect_warnings() as warning_log:
        assert_are(read(tmp_path / "run"), growing_maps()[:3])
    assert not warning_log.kinds
    (tmp_path / "run" / "run_0.mcap").unlink()
    (tmp_path / "run" / "summary.json").write_text("{}")
    assert_are(read(tmp_path / "run"), growing_maps())


def test_the_topic_is_the_one_asked_for_else_map_else_the_only_one(tmp_path):
    first, second, third = growing_maps(3)
    both = [("/map", START_NS, first), ("/costmap", START_NS, second), ("/empty_map", START_NS, Text(""))]
    path = write_mcap(tmp_path / "both.mcap", both)
    for asked, topic, expected in ((None, "/map", first), ("costmap", "/costmap", second)):
        with open_log(path, topic=asked) as log:
            assert log.topic == topic
            assert_are(list(log.snapshots()), [expected])
    with open_log(write_bag(tmp_path / "one.bag", [("/grid", START_NS, third)])) as log:
        assert log.topic == "/grid"
    several = [("/a", START_NS, first), ("/b", START_NS, second)]
    with pytest.raises(NoMapTopicError, match="/a, /b; choose one"):
        open_log(write_rosbag2(tmp_path / "several", several))
    with pytest.raises(NoMapTopicError, match=r"/other is not .* its map topics are /costmap, /map"):
        open_log(path, topic="/other")


def test_a_log_without_maps_can_be_inspected_but_not_opened(tmp_path):
    path = write_mcap(tmp_path / "talk.mcap", [("/chatter", START_NS, Text("hello"))])
    assert [topic.name for topic in inspect_log(path).topics] == ["/chatter"]
    with pytest.raises(NoMapTopicError, match=r"no topic has occupancy grids .* std_msgs/msg/String"):
        open_log(path)
    empty = write_mcap(tmp_path / "empty.mcap", [])
    info = inspect_log(empty)
    assert (info.start_ns, info.duration_s, info.topics) == (None, 0, ())
    with pytest.raises(NoMapTopicError):
        open_log(empty)


def test_a_map_topic_on_which_nothing_was_recorded_is_said_to_be_empty(tmp_path):
    bag = write_bag(tmp_path / "run.bag", [("/map_updates", START_NS, Update(0, 0, np.zeros((1, 1))))])
    with pytest.raises(NoMapTopicError):
        open_log(bag)
    log = [("/map", START_NS, growing_maps(1)[0])]
    path = write_rosbag2(tmp_path / "run", log)
    with sqlite3.connect(path / "run.db3") as database:
        database.execute("DELETE FROM messages")
    with pytest.raises(NoMapTopicError, match="no messages were recorded on the map topics /map"):
        open_log(path / "run.db3")


@pytest.mark.parametrize(
    ("name", "content", "match"),
    [
        ("missing.bag", None, "no such file"),
        ("empty.mcap", b"", "is empty"),
        ("text.mcap", b"just some text", "does not start like a .mcap"),
        ("text.bag", b"just some text", "does not start like a .bag"),
        ("text.db3", b"just some text", "does not start like a .db3"),
        ("short.bag", b"#ROSBAG V2.0\n", "is damaged"),
        ("short.mcap", b"\x89MCAP0\r\n", None),
        ("short.db3", b"SQLite format 3\0", "cannot be read as a bag"),
        ("laser.log", b"FLASER 1 2 3", "line 1 is no whole FLASER message"),
        ("run.zip", b"PK\3\4 and so on", "is an archive; unpack it"),
        ("run.tar.gz", b"\x1f\x8b and so on", "is an archive; unpack it"),
        ("text.log", b"just some text", "not a supported kind of log"),
        ("map.yaml", b"- a list", "does not describe a map"),
        ("metadata.yaml", b"rosbag2_bagfile_information:", "describes a ROS 2 bag; give its folder"),
        ("map.pgm", b"P5 1 1 255 \0", "map.yaml next to it"),
    ],
)
def test_what_is_no_log_ends_with_one_line_that_names_the_file(name, content, match, tmp_path):
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with (
        pytest.raises(LogError if "yaml" not in name else Exception, match=match) as caught,
        open_log(path) as log,
    ):
        list(log.snapshots())
    assert name in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_directory_that_is_no_log_ends_with_one_line(tmp_path):
    with pytest.raises(LogError, match="neither a bag"):
        open_log(tmp_path)
    (tmp_path / "metadata.yaml").write_text("a: [")
    with pytest.raises(LogError, match="does not describe a ROS 2 bag"):
        open_log(tmp_path)


def test_a_wrong_suffix_does_not_matter_the_content_does(tmp_path):
    path = write_mcap(tmp_path / "run.mcap", run_of_maps())
    assert_are(read(path.rename(tmp_path / "run.bag")), growing_maps())


@pytest.mark.parametrize(
    "name", ["bag", "mcap-zstd", "mcap-unchunked", "rosbag2-sqlite3-none", "rosbag2-mcap-none"]
)
def test_random_damage_gives_maps_or_a_known_error_never_a_crash(name, tmp_path):
    path = FORMATS[name](tmp_path, run_of_maps(3))
    file = path if path.is_file() else next(each for each in path.iterdir() if each.suffix != ".yaml")
    whole = file.read_bytes()
    rng = np.random.default_rng(5)
    logging.disable(logging.WARNING)
    try:
        for _ in range(60):
            data = bytearray(whole)
            for at in rng.integers(0, len(data), 8):
                data[at] = rng.integers(256)
            file.write_bytes(data)
            with contextlib.suppress(LogError, InvalidMapError):
                assert len(read(path)) <= 3
    finally:
        logging.disable(logging.NOTSET)


def test_importing_the_readers_loads_no_format_library():
    code = (
        "import sys, rose2_logs.io\n"
        "heavy = ('rosbags', 'mcap', 'apsw', 'google', 'PIL', 'yaml')\n"
        "print([name for name in heavy if name in sys.modules])"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert out.strip() == "[]"


@needs_shared
def test_the_three_forms_of_a_real_log_are_identical_and_equal_the_benchmark_maps():
    from PIL import Image

    forms = [
        read(SHARED / "bags" / name) for name in ("fr79.bag", "fr79.ros2_mcap", "fr79.ros2_sqlite3_zstd")
    ]
    assert len(forms[0]) == 13
    for other in forms[1:]:
        for one, two in zip(forms[0], other, strict=True):
            np.testing.assert_array_equal(one.cells, two.cells)
            assert one.geometry == two.geometry
            assert (one.index, one.log_time_ns, one.stamp_ns, one.topic) == (
                two.index, two.log_time_ns, two.stamp_ns, two.topic,
            )  # fmt: skip
    for k, snapshot in enumerate(forms[0]):
        image = np.asarray(
            Image.open(SHARED / "benchmark" / "incremental_fr79" / f"map{k + 3:02}.png").convert("L")
        )
        expected = np.select([image == 254, image == 0], [0, 100], -1)
        np.testing.assert_array_equal(snapshot.cells, expected[::-1])


@needs_shared
def test_a_real_canvas_that_moves_and_grows_stays_in_place_in_the_world():
    snapshots = read(SHARED / "bags" / "intel.ros2_mcap")
    assert len(snapshots) == 22
    assert len({each.geometry.shape for each in snapshots}) > 1
    assert len({each.geometry.origin_xy_m for each in snapshots}) > 1
    for before, now in itertools.pairwise(snapshots):
        # Most walls of one map are walls of the next one, within two cells of the same place in the world;
        # the mapper's corrections move the others.
        rows, columns = np.nonzero(before.cells == 100)
        walls = binary_dilation(now.cells == 100, np.ones((3, 3)), iterations=2)
        there = now.geometry.world_to_cell(before.geometry.cell_centers(rows, columns))
        assert walls[there[:, 0], there[:, 1]].mean() > 0.5


@needs_shared
@pytest.mark.parametrize("name", ["base_cmaps.bag", "base_cmaps_mcap"])
def test_a_third_party_log_with_two_costmaps_asks_which(name):
    path = SHARED / "bags" / "third_party" / name
    topics = [f"/move_base/{which}_costmap/costmap" for which in ("global", "local")]
    with pytest.raises(NoMapTopicError, match=", ".join(topics)):
        open_log(path)
    sizes = [read(path, topic=topic)[0].geometry.shape for topic in topics]
    assert sizes[0] != sizes[1]


@needs_shared
@pytest.mark.parametrize("name", ["grid_map.bag", "no_map_cartographer.bag"])
def test_a_third_party_log_without_maps_says_so_in_one_line(name):
    path = SHARED / "bags" / "third_party" / name
    with pytest.raises(NoMapTopicError, match="no topic has occupancy grids") as caught:
        open_log(path)
    assert "\n" not in str(caught.value)
    assert inspect_log(path).topics


def test_a_sector_that_cannot_be_read_is_damage_and_a_lost_network_is_not(tmp_path, monkeypatch):
    """The first costs a map; the second may pass, so it is no verdict on the log."""
    from rose2_logs.io import checked_file

    maps, messages = noisy_run()
    path = FORMATS["mcap-uncompressed"](tmp_path, messages)
    at = path.read_bytes().index(serialized(maps[2], 2)[-2000:-1000])
    read_file = checked_file.io.FileIO.read
    for number, code in enumerate((errno.EIO, errno.ESTALE)):

        class FailingFile(checked_file.io.FileIO):
            failure = code

            def read(self, size=-1, /):
                if self.tell() <= at < self.tell() + size:
                    raise OSError(self.failure, "broken")
                return read_file(self, size)

        class Checked(checked_file.CheckedFile, FailingFile):
            pass

        monkeypatch.setattr("rose2_logs.io.mcap.index.CheckedFile", Checked)
        with open_log(path) as log:
            if number == 0:
                assert len(list(log.snapshots())) == 4
                assert log.counts.damaged == 1
            else:
                with pytest.raises(OSError, match="broken"):
                    list(log.snapshots())
