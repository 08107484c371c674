"""Every fault in every kind of log gives what docs/faults.md says, and never a silently wrong map."""

from __future__ import annotations

import re
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from bombs import BOMBS
from fault_table import LIMITS, PAGE, TABLES, expected, make, outcome
from faulty_logs import COUNT, INPUTS, MESSAGE_FAULTS, SEEN, Grid, room

from rose2_logs.io import open_log
from rose2_logs.system.warnings import StrictError, collect_warnings

CASES = [(table, *case) for table, cases in TABLES.items() for case in cases()]
PEAK_BYTES = 3 * LIMITS.chunk_max_bytes
"""What reading a log of some kilobytes may take: a chunk as read, as decompressed, and as parsed."""


def cases(*tables: str):
    chosen = [case for case in CASES if case[0] in tables]
    return pytest.mark.parametrize(
        ("table", "fault", "kind"), chosen, ids=[" / ".join(case) for case in chosen]
    )


@pytest.fixture(scope="module")
def page():
    return {table: expected(table) for table in TABLES}


@cases("messages", "files", "saved maps")
def test_each_fault_has_the_outcome_that_the_page_tells(table, fault, kind, page, tmp_path):
    assert outcome(make(table, (fault, kind), tmp_path)) == page[table].pop((fault, kind))


@cases("bombs")
def test_a_bomb_is_told_and_takes_no_more_memory_than_the_cap(table, fault, kind, page, tmp_path):
    log = make(table, (fault, kind), tmp_path)
    tracemalloc.start()
    try:
        assert outcome(log) == page[table][fault, kind]
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < PEAK_BYTES


def test_the_page_tells_of_no_fault_that_is_not_tried(page):
    """Those that were tried in this process were taken out; a page of old faults would keep some."""
    known = {(table, (fault, kind)) for table, fault, kind in CASES}
    assert {(table, case) for table, told in page.items() for case in told} <= known


# Faults after which each map must be one of those that were written; bags and databases without checksums
# cannot tell that bytes of a map have changed.
CHECKED = ("MCAP, zstd", "MCAP, lz4", "MCAP, plain", "MCAP, no index", "ROS 1 bag, bz2")
HARMLESS = {"cells out of range", "bytes after the fields", "quaternion not unit", "quaternion all zero"}


@pytest.mark.parametrize("kind", CHECKED)
def test_what_is_read_of_a_damaged_file_is_what_was_written(kind, tmp_path):
    written = {room(SEEN[k], k).tobytes() for k in range(COUNT)}
    for number, (fault, name) in enumerate(TABLES["files"]()):
        if name != kind:
            continue
        (tmp_path / str(number)).mkdir()
        log = make("files", (fault, name), tmp_path / str(number))
        if outcome(log).startswith("error"):
            continue
        with open_log(log, limits=LIMITS) as reader:
            assert {each.cells.tobytes() for each in reader.snapshots()} <= written, fault


@pytest.mark.parametrize("fault", [name for name in MESSAGE_FAULTS if not name.startswith("all ")])
def test_what_is_read_of_a_log_with_a_faulty_message_is_what_its_other_messages_hold(fault, tmp_path):
    logged = MESSAGE_FAULTS[fault]()
    log = INPUTS["MCAP, zstd"].make(tmp_path, logged)
    if outcome(log).startswith("error"):
        return
    written = {each.data for _, _, each in logged if isinstance(each, Grid)}
    with open_log(log, limits=LIMITS) as reader:
        for snapshot in reader.snapshots():
            cells = snapshot.cells.tobytes()
            assert cells in written or (fault in HARMLESS and (snapshot.cells == -1).all())


@pytest.mark.parametrize(
    ("table", "fault", "kind"),
    [
        ("messages", "resolution NaN", "ROS 1 bag"),
        ("messages", "patch outside the map", "ROS 2, sqlite3"),
        ("messages", "frame changes", "MCAP, zstd"),
        ("files", "cut at 60 %", "MCAP, zstd"),
        ("files", "cut at 60 %", "ROS 1 bag"),
        ("files", "cut in the last bytes", "ROS 2, sqlite3"),
        ("files", "metadata.yaml empty", "ROS 2, mcap"),
        ("saved maps", "image claims 2^31 - 1 squared", "map_server, png"),
        ("bombs", next(iter(BOMBS)), ""),
    ],
)
def test_where_it_is_asked_for_the_first_warning_is_an_error(table, fault, kind, tmp_path):
    log = make(table, (fault, kind), tmp_path)
    with (
        collect_warnings(strict=True),
        pytest.raises(StrictError, match="--strict") as caught,
        open_log(log, limits=LIMITS) as reader,
    ):
        list(reader.snapshots())
    assert "\n" not in str(caught.value)
    assert caught.value.file is not None


def test_a_lost_map_takes_the_patches_after_it_along(tmp_path):
    """A patch that was made for a map that is lost would make a wrong map of the one before."""
    log = INPUTS["MCAP, zstd"].make(tmp_path, MESSAGE_FAULTS["patch after a map that is left out"]())
    with open_log(log) as reader:
        snapshots = list(reader.snapshots())
    for snapshot, k in zip(snapshots, (0, 1, 3, 4), strict=True):
        np.testing.assert_array_equal(snapshot.cells, room(SEEN[k], k))


def test_every_kind_of_warning_is_explained_on_the_page():
    """Those that the code can give, wherever it is."""
    kinds = set()
    for path in (Path(__file__).parents[2] / "rose2_logs").rglob("*.py"):
        code = path.read_text(encoding="utf-8")
        kinds |= set(re.findall(r'(?:log_warning\(logger, |MapWarning\(\s*)"(\w+)"', code))
    assert "invalid_map" not in kinds, "that one is chosen by the error"
    explained = set(
        re.findall(r"`(\w+)`", PAGE.read_text(encoding="utf-8").partition("## Faults of messages")[0])
    )
    assert kinds | {"invalid_map", "damaged_message"} <= explained
    assert len(kinds) > 15
