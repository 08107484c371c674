"""What is left out of a recording changes nothing that a viewer shows."""

from __future__ import annotations

import tempfile
from collections import defaultdict
from itertools import accumulate
from pathlib import Path

import numpy as np
import rerun as rr
from hypothesis import given, settings
from hypothesis import strategies as st
from rerun.chunk import RrdReader

from rose2_logs.sinks.rerun_layers import ChangedLayers

TIMELINES = ("message_log_time", "ros2_timestamp", "snapshot", "coverage")
COMPONENTS = {"/line": "LineStrips3D:strips", "/picture": "Scalars:scalars"}

Row = dict[str, int]
Step = tuple[int, int, int]
"""Coverage, content of the line, of the picture."""


def written(steps: list[Step], stamps: list[int]) -> dict[str, list[Row]]:
    """Rows of each path that stand in a recording, in the order in which they were logged."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.rrd"
        recording = rr.RecordingStream("test", batcher_config=rr.ChunkBatcherConfig.NEVER())
        recording.set_sinks(rr.FileSink(str(path)))
        recording.set_log_time_enabled(False)
        recording.set_log_tick_enabled(False)
        layers = ChangedLayers(recording)
        for index, ((coverage, line, picture), stamp) in enumerate(zip(steps, stamps, strict=True)):
            layers.begin(10 * index, stamp, index, coverage)
            layers.log("/line", rr.LineStrips3D.from_fields(strips=[[[line, 0, 0], [line, 1, 0]]]))
            layers.log_picture("/picture", rr.Scalars(picture))
        recording.flush(timeout_sec=10)
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
    furthest = list(accumulate((step[0] for step in steps), max))
    return {
        name: [
            {
                "message_log_time": 10 * index,
                "ros2_timestamp": stamps[index],
                "snapshot": index,
                "coverage": furthest[index],
                "order": index,
                "content": step[layer],
            }
            for index, step in enumerate(steps)
        ]
        for layer, name in enumerate(COMPONENTS, start=1)
    }


STEPS = st.lists(st.tuples(st.integers(0, 9), st.integers(0, 1), st.integers(0, 1)), min_size=1, max_size=9)


@given(STEPS)
@settings(max_examples=25, deadline=None)
def test_a_viewer_shows_the_same_everywhere_on_every_timeline(steps: list[Step]):
    """Coverage may go back: the snapshot then stands at the greatest coverage so far."""
    stamps = [5 * index for index in range(len(steps))]
    found, full = written(steps, stamps), everything(steps, stamps)
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


def test_stamps_that_go_back_make_everything_be_logged_until_they_have_caught_up():
    """At each stamp logged so, and where they have caught up, stands what the snapshot showed."""
    steps, stamps = [(1, 0, 0), (1, 0, 0), (1, 1, 1), (1, 1, 1), (1, 1, 1), (1, 1, 1)], [7, 8, 4, 5, 9, 9]
    found = written(steps, stamps)
    assert [row["snapshot"] for row in found["/line"]] == [0, 2, 3, 4]
    assert [shown(found["/picture"], "ros2_timestamp", at) for at in (4, 5, 9)] == [1, 1, 1]
