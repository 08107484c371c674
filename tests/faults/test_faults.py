"""Every fault in every kind of log gives what docs/faults.md says, and never a silently wrong map."""

from __future__ import annotations

import re
import traceback
import tracemalloc
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from bombs import BOMBS
from fault_table import LIMITS, PAGE, TABLES, expected, make, outcome
from faulty_logs import COUNT, INPUTS, MESSAGE_FAULTS, SEEN, Grid, room

from rose2_logs.io import open_log
from rose2_logs.system.warnings import StrictError, collect_warnings

PEAK_BYTES = 3 * LIMITS.chunk_max_bytes
"""What reading a log of some kilobytes may take: a chunk as read, as decompressed, and as parsed."""
KINDS = [
    (table, kind)
    for table in ("messages", "files", "saved maps")
    for kind in dict.fromkeys(kind for _, kind in TABLES[table]())
]


def faults(table: str, kind: str, tmp_path: Path) -> Iterator[tuple[str, Path]]:
    """Yield each fault of a kind of log with an empty folder for it."""
    for number, (fault, name) in enumerate(TABLES[table]()):
        if name == kind:
            folder = tmp_path / str(number)
            folder.mkdir()
            yield fault, folder


def told(log: Path) -> str:
    """Tell what came of a log, an error that is not a known one too; its traceback goes to stderr."""
    try:
        return outcome(log)
    except Exception as error:
        traceback.print_exc()
        return f"raised {error!r}"


@pytest.mark.parametrize(("table", "kind"), KINDS, ids=[" / ".join(each) for each in KINDS])
def test_each_fault_has_the_outcome_that_the_page_tells(table, kind, tmp_path):
    page = expected(table)
    differing = []
    for fault, folder in faults(table, kind, tmp_path):
        found, wanted = told(make(table, (fault, kind), folder)), page.get((fault, kind))
        differing += [f"{fault}: {found}\n    on the page: {wanted}"] if found != wanted else []
    assert not differing, "\n".join(differing)


def test_a_bomb_is_told_and_takes_no_more_memory_than_the_cap(tmp_path):
    page = expected("bombs")
    differing = []
    for fault, folder in faults("bombs", "", tmp_path):
        log = make("bombs", (fault, ""), folder)
        tracemalloc.start()
        try:
            found = told(log)
            peak = tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()
        if found != (wanted := page.get((fault, ""))) or peak >= PEAK_BYTES:
            differing.append(f"{fault}: {found}, {peak} bytes\n    on the page: {wanted}")
    assert not differing, "\n".join(differing)


@pytest.mark.parametrize("table", TABLES)
def test_the_page_tells_of_every_fault_that_is_tried_and_of_no_other(table):
    assert set(expected(table)) == set(TABLES[table]())


# Faults after which each map must be one of those that were written; bags and databases without checksums
# cannot tell that bytes of a map have changed.
CHECKED = ("MCAP, zstd", "MCAP, lz4", "MCAP, plain", "MCAP, no index", "ROS 1 bag, bz2")
HARMLESS = {"cells out of range", "bytes after the fields", "quaternion not unit", "quaternion all zero"}


@pytest.mark.parametrize("kind", CHECKED)
def test_what_is_read_of_a_damaged_file_is_what_was_written(kind, tmp_path):
    written = {room(SEEN[k], k).tobytes() for k in range(COUNT)}
    wrong = []
    for fault, folder in faults("files", kind, tmp_path):
        log = make("files", (fault, kind), folder)
        if told(log).startswith("error"):
            continue
        with open_log(log, limits=LIMITS) as reader:
            if not {each.cells.tobytes() for each in reader.snapshots()} <= written:
                wrong.append(fault)
    assert wrong == []


def test_what_is_read_of_a_log_with_a_faulty_message_is_what_its_other_messages_hold(tmp_path):
    wrong = []
    for fault, folder in faults("messages", "MCAP, zstd", tmp_path):
        if fault.startswith("all ") or fault not in MESSAGE_FAULTS:
            continue
        logged = MESSAGE_FAULTS[fault]()
        log = INPUTS["MCAP, zstd"].make(folder, logged)
        if told(log).startswith("error"):
            continue
        written = {each.data for _, _, each in logged if isinstance(each, Grid)}
        with open_log(log, limits=LIMITS) as reader:
            wrong += [
                f"{fault}: map {snapshot.index}"
                for snapshot in reader.snapshots()
                if snapshot.cells.tobytes() not in written
                and not (fault in HARMLESS and (snapshot.cells == -1).all())
            ]
    assert wrong == []


STRICT = [
    ("messages", "resolution NaN", "ROS 1 bag"),
    ("messages", "patch outside the map", "ROS 2, sqlite3"),
    ("messages", "frame changes", "MCAP, zstd"),
    ("files", "cut at 60 %", "MCAP, zstd"),
    ("files", "cut at 60 %", "ROS 1 bag"),
    ("files", "cut in the last bytes", "ROS 2, sqlite3"),
    ("files", "metadata.yaml empty", "ROS 2, mcap"),
    ("saved maps", "image claims 2^31 - 1 squared", "map_server, png"),
    ("bombs", next(iter(BOMBS)), ""),
]


def test_where_it_is_asked_for_the_first_warning_is_an_error(tmp_path):
    for number, (table, fault, kind) in enumerate(STRICT):
        (tmp_path / str(number)).mkdir()
        log = make(table, (fault, kind), tmp_path / str(number))
        print(f"{table} / {fault} / {kind}")
        with (
            collect_warnings(strict=True),
            pytest.raises(StrictError, match="strict=True") as caught,
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
