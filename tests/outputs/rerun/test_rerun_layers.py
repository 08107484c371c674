"""What is left out of a recording changes nothing that a viewer shows."""

from __future__ import annotations

import tempfile
from collections import defaultdict
from itertools import accumulate
from pathlib import Path

import numpy as np
import rerun as rr
from commands import WAIT_S
from hypothesis import example, given, settings
from hypothesis import strategies as st
from rerun.chunk import RrdReader

from rose2_logs.outputs.rerun.columns import Label, Picture, Strips
from rose2_logs.outputs.rerun.layers import Layers, whole_percent

TIMELINES = ("message_log_time", "ros2_timestamp", "snapshot", "coverage_percent")
COMPONENTS = {"/line": "LineStrips3D:strips", "/picture": "GridMap:data", "/label": "Points3D:labels"}

Row = dict[str, int]
Step = tuple[int, int, int]
"""Coverage, content of line and label, of the picture."""


def written(steps: list[Step], stamps: list[int], chunk_bytes: int = 600) -> dict[str, list[Row]]:
    """Rows of each path that stand in a recording, in the order in which they were logged."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.rrd"
        recording = rr.RecordingStream("test")
        recording.set_sinks(rr.FileSink(str(path)))
        recording.set_log_time_enabled(False)
        recording.set_log_tick_enabled(False)
        layers = Layers(recording, chunk_bytes)
        for index, ((coverage, line, picture), stamp) in enumerate(zip(steps, stamps, strict=True)):
            layers.begin(10 * index, stamp, index, coverage)
            points = np.array([[line, 0, 0], [line, 1, 0]], np.float32)
            layers.show("/line", Strips(points, np.array([2], np.int32)))
            layers.show("/label", Label((0.0, 0.0, 0.0), str(line)))
            pixels = np.full((3, 4), picture, np.uint8)
            layers.show("/picture", Picture(pixels, 0.05, (0.0, 0.0, 0.0), 0.3))
        layers.flush()
        recording.flush(timeout_sec=WAIT_S)
        recording.disconnect()
        rows: dict[str, list[Row]] = defaultdict(list)
        for chunk in RrdReader(str(path)).stream():
            if (name := str(chunk.entity_path)) in COMPONENTS:
                batch = chunk.to_record_batch()
                columns = {each: batch.column(each).cast("int64").to_pylist() for each in TIMELINES}
                columns["order"] = batch.column("rerun.controls.RowId").to_pylist()
                contents = batch.column(COMPONENTS[name]).to_pylist()
                columns["content"] = [int(np.ravel(content[0])[0]) for content in contents]
                rows[name] += [
                    dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)
                ]
        return {name: sorted(found, key=lambda row: row["order"]) for name, found in rows.items()}


def shown(rows: list[Row], timeline: str, at: int) -> int | None:
    """What a viewer shows: the row logged last among those of the latest time that is not after the place."""
    before = [row for row in rows if row[timeline] <= at]
    return max(before, key=lambda row: (row[timeline], row["order"]))["content"] if before else None


def everything(steps: list[Step], stamps: list[int]) -> dict[str, list[Row]]:
    """The rows if every layer is logged at every snapshot."""
    furthest, latest = (list(accumulate(each, max)) for each in ((step[0] for step in steps), stamps))
    return {
        name: [
            {
                "message_log_time": 10 * index,
                "ros2_timestamp": latest[index],
                "snapshot": index,
                "coverage_percent": furthest[index],
                "order": index,
                "content": step[layer],
            }
            for index, step in enumerate(steps)
        ]
        for name, layer in (("/line", 1), ("/picture", 2), ("/label", 1))
    }


STEPS = st.lists(st.tuples(st.integers(0, 9), st.integers(0, 1), st.integers(0, 1)), min_size=1, max_size=9)


@given(STEPS, st.lists(st.integers(0, 40), min_size=9, max_size=9), st.sampled_from([0, 600, 10**6]))
@settings(max_examples=25)
def test_a_viewer_shows_the_same_everywhere_on_every_timeline(
    steps: list[Step], stamps: list[int], chunk_bytes: int
):
    """Coverage and stamps may go back: the snapshot then stands at the greatest so far.

    Each row in a chunk of its own, some together, or all in one.
    """
    stamps = stamps[: len(steps)]
    found, full = written(steps, stamps, chunk_bytes), everything(steps, stamps)
    for name in COMPONENTS:
        for timeline in TIMELINES:
            places = {row[timeline] for row in full[name]}
            for at in {place + step for place in places for step in (-1, 0, 1)}:
                assert shown(found[name], timeline, at) == shown(full[name], timeline, at)


def test_what_stays_is_logged_once():
    """One row for each change."""
    found = written([(1, 0, 0), (2, 0, 0), (2, 0, 1), (5, 1, 1), (9, 1, 1)], [0, 1, 2, 3, 4])
    assert [row["snapshot"] for row in found["/line"]] == [0, 3]
    assert [row["snapshot"] for row in found["/picture"]] == [0, 2]


def test_lines_of_their_own_colors_and_none_at_all():
    """Rows of several strips, of one, of none: each strip keeps its corners and its color."""
    strips = [[3, 2], [], [2]]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.rrd"
        recording = rr.RecordingStream("test")
        recording.set_sinks(rr.FileSink(str(path)))
        layers = Layers(recording)
        for index, lengths in enumerate(strips):
            points = np.arange(3 * sum(lengths), dtype=np.float32).reshape(-1, 3)
            colors = np.full((len(lengths), 3), index, np.uint8)
            layers.begin(index, index, index, index)
            layers.show("/line", Strips(points, np.array(lengths, np.int32), colors))
            layers.show("/none", Strips(points[:0], np.zeros(0, np.int32), colors[:0]))
        layers.flush()
        recording.flush(timeout_sec=WAIT_S)
        recording.disconnect()
        batches = {str(c.entity_path): c.to_record_batch() for c in RrdReader(str(path)).stream()}
    found = batches["/line"].column("LineStrips3D:strips").to_pylist()
    assert [[len(strip) for strip in row] for row in found] == strips
    assert found[0][1][0] == [9.0, 10.0, 11.0]
    assert [len(row) for row in batches["/line"].column("LineStrips3D:colors").to_pylist()] == [2, 0, 1]
    assert batches["/none"].num_rows == 1


def test_a_cleared_path_is_empty_from_then_on_where_the_coverage_stays():
    """What waited is written before: at one place of a timeline the last one counts."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.rrd"
        recording = rr.RecordingStream("test")
        recording.set_sinks(rr.FileSink(str(path)))
        layers = Layers(recording)
        for index in range(3):
            layers.begin(index, index, index, 5)
            if index < 2:
                layers.show("/room/1", Label((0.0, 0.0, 0.0), str(index)))
                layers.show("/room/1/label", Label((0.0, 0.0, 0.0), str(index)))
            else:
                layers.clear("/room/1")
        layers.flush()
        recording.flush(timeout_sec=WAIT_S)
        recording.disconnect()
        last, cleared = {}, {}
        for chunk in RrdReader(str(path)).stream():
            batch = chunk.to_record_batch()
            rows = batch.column("rerun.controls.RowId").to_pylist()
            found = cleared if "Clear:is_recursive" in batch.schema.names else last
            found[str(chunk.entity_path)] = max(rows)
    assert set(last) >= {"/room/1", "/room/1/label"}
    assert cleared["/room/1"] > max(last["/room/1"], last["/room/1/label"])


def test_no_more_rows_wait_than_were_allowed():
    """When all that wait have the size, the entity with most is written; the others go on waiting."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.rrd"
        recording = rr.RecordingStream("test", send_properties=False)
        recording.set_sinks(rr.FileSink(str(path)))
        layers = Layers(recording, chunk_bytes=10**6, waiting_bytes=10_000)
        for index in range(9):
            layers.begin(index, index, index, index)
            layers.show("/picture", Picture(np.full((10, 20), index, np.uint8), 0.05, (0.0, 0.0, 0.0), 0.3))
            if index % 2:
                layers.show("/label", Label((0.0, 0.0, 0.0), str(index)))
        layers.flush()
        layers.begin(9, 9, 9, 9)
        layers.show("/label", Label((0.0, 0.0, 0.0), "9"))
        layers.flush()
        recording.flush(timeout_sec=WAIT_S)
        recording.disconnect()
        chunks = [
            (str(chunk.entity_path), chunk.to_record_batch()) for chunk in RrdReader(str(path)).stream()
        ]
    chunks.sort(key=lambda chunk: chunk[1].column("rerun.controls.RowId")[0].as_py())
    rows = [(name, batch.num_rows) for name, batch in chunks]
    assert rows == [("/picture", 6), ("/picture", 3), ("/label", 4), ("/label", 1)]


@given(st.integers(1, 10**8).flatmap(lambda cells: st.tuples(st.integers(0, cells), st.just(cells))))
@example((29, 100))
def test_coverage_in_whole_percent_is_that_of_the_cells_rounded_down(seen: tuple[int, int]):
    """Only the whole is 100; 29 of 100 cells are 29 %, though 100 times 0.29 is less."""
    cells, of_cells = seen
    assert whole_percent(cells / of_cells) == 100 * cells // of_cells
