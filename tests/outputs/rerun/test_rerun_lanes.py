"""Lanes of rooms: forming, of their last shape, settled, and gaps where they were lost."""

from __future__ import annotations

import rerun as rr
from commands import WAIT_S

from rose2_logs.drawing.palette import FORMING, SETTLED, SHAPED, TEMPORARY
from rose2_logs.outputs.rerun.lanes import LOST, TrackLanes
from rose2_logs.outputs.rerun.layers import Instant
from rose2_logs.tracking.convergence import Convergence
from rose2_logs.tracking.track_history import SnapshotRef


def lanes(tmp_path, tracks_of_maps, convergence) -> dict[str, list[tuple[int, str]]]:
    """Snapshot and state of each change, by lane, as they stand in the recording."""
    from rerun.chunk import RrdReader

    recording = rr.RecordingStream("test")
    recording.set_sinks(rr.FileSink(str(tmp_path / "run.rrd")))
    histories = TrackLanes(recording)
    for index, tracks in enumerate(tracks_of_maps):
        histories.add(Instant(index, index, 10 + index, 100 * index), tracks)
    histories.log(convergence)
    recording.flush(timeout_sec=WAIT_S)
    recording.disconnect()
    found = {}
    for chunk in RrdReader(str(tmp_path / "run.rrd")).stream():
        batch = chunk.to_record_batch()
        if "StateChange:state" in batch.schema.names:
            states = [row[0] for row in batch.column("StateChange:state").to_pylist()]
            found[str(chunk.entity_path)] = list(
                zip(batch.column("snapshot").to_pylist(), states, strict=True)
            )
    return found


def snapshot_ref(snapshot: int) -> SnapshotRef:
    return SnapshotRef(snapshot, 0.0, 0.0)


def test_states_follow_one_another_and_a_lost_room_leaves_a_gap(tmp_path):
    """Room 1 is there throughout; 2 is lost for a map and comes back when it is settled."""
    maps = [(1,), (1, 2), (1, 2, 3), (1,), (1, 2), (1, 2)]
    convergence = Convergence(
        area_settled={1: snapshot_ref(14), 2: snapshot_ref(14), 3: snapshot_ref(12)},
        shape_right={1: snapshot_ref(12)},
    )
    found = lanes(tmp_path, maps, convergence)
    assert found["/room/1"] == [(10, FORMING), (12, SHAPED), (14, SETTLED)]
    assert found["/room/2"] == [(11, FORMING), (13, LOST), (14, SETTLED)]


def test_a_room_that_is_gone_in_the_end_never_settles(tmp_path):
    """Whatever its convergence says, which is about its own last shape: 3 comes and goes, 4 does so twice."""
    maps = [(1, 4), (1,), (1, 3, 4), (1,)]
    convergence = Convergence(
        area_settled={1: snapshot_ref(10), 3: snapshot_ref(12), 4: snapshot_ref(12)},
        shape_right={1: snapshot_ref(10), 4: snapshot_ref(10)},
    )
    found = lanes(tmp_path, maps, convergence)
    assert found["/room/3"] == [(12, TEMPORARY), (13, LOST)]
    assert found["/room/4"] == [(10, TEMPORARY), (11, LOST), (12, TEMPORARY), (13, LOST)]
    assert found["/room/1"] == [(10, SETTLED)]


def test_lanes_tell_what_the_rooms_are_called(tmp_path):
    """In each of their states; the path keeps the track's number."""
    from rerun.chunk import RrdReader

    recording = rr.RecordingStream("test")
    recording.set_sinks(rr.FileSink(str(tmp_path / "run.rrd")))
    histories = TrackLanes(recording, {1: "Kitchen", 2: "Room 2"}.__getitem__)
    histories.add(Instant(0, 0, 0, 0), (1, 2))
    histories.log(Convergence())
    recording.flush(timeout_sec=WAIT_S)
    recording.disconnect()
    told = {}
    for chunk in RrdReader(str(tmp_path / "run.rrd")).stream():
        batch = chunk.to_record_batch()
        if "StateConfiguration:labels" in batch.schema.names:
            (told[str(chunk.entity_path)],) = batch.column("StateConfiguration:labels").to_pylist()
    assert set(told) == {"/room/1", "/room/2"}
    assert all(label.startswith("Kitchen: ") for label in told["/room/1"])
    assert f"Room 2: {SETTLED}" in told["/room/2"]
