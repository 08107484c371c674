"""Back-projected rooms in a recording, read back by Rerun: they are those of the table, on every timeline."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import rerun as rr
from drawn_rooms import drawn
from finished_runs import SAMPLE_LOGS
from rerun.chunk import RrdReader

from rose2_logs.drawing.palette import track_color
from rose2_logs.outputs.rerun.back_projected import BackProjectedWorld
from rose2_logs.outputs.rerun.layers import Layers
from rose2_logs.outputs.rerun.pictures import FILL_OPACITY
from rose2_logs.system.text import percent
from rose2_logs.tracking.back_projection import BackProjectedRooms, BackProjectedSnapshot
from rose2_logs.tracking.registration import RigidMotion
from rose2_logs.workflows.analyze import RunOptions, RunResult, analyze_log

TIMELINES = ("message_log_time", "ros2_timestamp", "snapshot", "coverage_percent")
CELL_M2 = 0.05**2


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> RunResult:
    options = RunOptions(max_snapshots=6, annotated_log=False, layers=(), back_project=True)
    return analyze_log(
        SAMPLE_LOGS / "office.mcap", tmp_path_factory.mktemp("back_projected") / "office", options
    )


@pytest.fixture(scope="module")
def back_projected(result: RunResult) -> pd.DataFrame:
    """The table: areas (maps, tracks), 0 where a map shows nothing of a room."""
    table = pd.read_parquet(result.folder / "back_projected.parquet")
    return table.pivot_table(index="snapshot", columns="track", values="area_m2", fill_value=0.0)


def rows(result: RunResult, entity: str, component: str) -> Iterator[dict[str, Any]]:
    """What an entity shows, with its times."""
    for chunk in RrdReader(str(result.folder / "office.rrd")).stream():
        batch = chunk.to_record_batch()
        if str(chunk.entity_path) == entity and {component, "snapshot"} <= set(batch.schema.names):
            yield from batch.select([*TIMELINES, component]).to_pylist()


def shown_at(found: list[dict[str, Any]], timeline: str, at: Any) -> dict[str, Any]:
    return max(
        (row for row in found if row[timeline] <= at), key=lambda row: (row[timeline], row["snapshot"])
    )


@pytest.mark.parametrize("timeline", TIMELINES)
def test_every_map_shows_the_floor_that_the_table_tells_of_each_room(result, back_projected, timeline):
    """In the color of the room's track: so many pixels are of it, at the map's place of each timeline."""
    pictures = list(rows(result, "/world/back_projected", "GridMap:data"))
    snapshot_refs = {row["snapshot"]: row for row in rows(result, "/run/coverage", "Scalars:scalars")}
    assert list(snapshot_refs) == list(back_projected.index)
    for snapshot, areas in back_projected.iterrows():
        row = shown_at(pictures, timeline, snapshot_refs[snapshot][timeline])
        pixels = np.array(row["GridMap:data"][0], np.uint8).reshape(-1, 4)[:, :3]
        for track, area in areas.items():
            fill = FILL_OPACITY * np.array(track_color(track)) + (1 - FILL_OPACITY) * 255
            count = (pixels == fill.astype(np.uint8)).all(axis=1).sum()
            assert count * CELL_M2 == pytest.approx(area), (snapshot, track)


def test_how_much_of_each_room_was_seen_is_that_of_the_table(result, back_projected):
    last = pd.read_parquet(result.folder / "rooms.parquet").set_index(["snapshot", "track"]).area_m2
    for track, areas in back_projected.items():
        share = {
            row["snapshot"]: row["Scalars:scalars"][0]
            for row in rows(result, f"/run/seen_share/{track}", "Scalars:scalars")
        }
        assert share == pytest.approx((100 * areas / last[back_projected.index[-1], track]).to_dict())


def test_a_room_is_named_from_when_it_is_seen(result, back_projected):
    """By its number, and where there is room for it by how much of it was seen."""
    last = pd.read_parquet(result.folder / "rooms.parquet").set_index(["snapshot", "track"]).area_m2
    texts = {}
    for track, areas in back_projected.items():
        named = list(rows(result, f"/world/back_projected/names/{track}", "Points3D:labels"))
        assert named[0]["snapshot"] == areas.index[areas > 0][0]
        at = areas.index[areas > 0][0]
        seen = percent(min(areas[at] / last[back_projected.index[-1], track], 1.0))
        texts[track] = shown_at(named, "snapshot", at)["Points3D:labels"][0]
        assert texts[track] in (f"{track}", f"{track}: {seen}")
    assert any(":" in text for text in texts.values())


def test_the_outlines_are_those_of_the_last_map_from_the_first_on(result):
    """The map never moves in a simulated log, so that they are written once."""
    (outlines,) = rows(result, "/world/back_projected/outlines", "LineStrips3D:strips")
    tracks = pd.read_parquet(result.folder / "tracks.parquet")
    assert outlines["snapshot"] == 0
    assert len(outlines["LineStrips3D:strips"]) >= tracks.in_last_map.sum()


def test_there_is_a_tab_for_them(result, tmp_path: Path):
    assert {"Rooms projected back", "Seen share, %"} < names_of_views(result.folder / "office.rrd")
    options = RunOptions(max_snapshots=2, annotated_log=False, layers=())
    plain = analyze_log(SAMPLE_LOGS / "office.mcap", tmp_path / "office", options).folder / "office.rrd"
    assert not {"Rooms projected back", "Seen share, %"} & names_of_views(plain)
    paths = {str(chunk.entity_path) for chunk in RrdReader(str(plain)).stream()}
    assert not any("back_projected" in path or "seen" in path for path in paths)


def names_of_views(recording: Path) -> set[str]:
    reader = RrdReader(str(recording))
    found: set[str] = set()
    # The layout at the end knows of more than the one before the first map.
    for layout in reader.blueprints():
        for chunk in reader.stream(store=layout):
            batch = chunk.to_record_batch()
            for name in batch.schema.names:
                if name.endswith("display_name"):
                    found |= {each[0] for each in batch.column(name).to_pylist() if each}
    return found


def test_outlines_lie_where_the_rooms_lay_before_the_map_shifted(tmp_path: Path):
    """The whole map moved by 2 m and 1 m after this one."""
    snapshot, analysis = drawn(np.ones((3, 4), int))
    rooms = analysis.rooms
    found = BackProjectedRooms(rooms.labels, rooms.areas_m2)
    to_last = RigidMotion((0.0, 0.0), (2.0, 1.0), 0.0)
    recording = rr.RecordingStream("test")
    recording.set_sinks(rr.FileSink(str(tmp_path / "run.rrd")))
    world = BackProjectedWorld(Layers(recording), recording)
    world.log(BackProjectedSnapshot(snapshot, 1.0, found, rooms, (7,), to_last), 10_000, 20.0)
    world.flush()
    recording.disconnect()
    for chunk in RrdReader(str(tmp_path / "run.rrd")).stream():
        if "LineStrips3D:strips" in chunk.to_record_batch().schema.names:
            strip = np.array(chunk.to_record_batch().column("LineStrips3D:strips").to_pylist()[0][0])
            assert strip[:, :2].min(axis=0).tolist() == [-2.0, -1.0]
            assert strip[:, :2].max(axis=0).tolist() == [2.0, 2.0]
            break
    else:
        pytest.fail("no outline was written")
