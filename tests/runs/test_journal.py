"""The journal of a run: what is whole is given back, what was cut off or damaged is dropped."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from drawn_maps import office, snapshot

from rose2_logs.config.parameters import Parameters
from rose2_logs.errors import InvalidMapError, OutputError
from rose2_logs.model.occupancy import OccupancySnapshot
from rose2_logs.runs.journal import MAGIC, Found, Journal, JournaledWorkers, kept_maps
from rose2_logs.segmentation.pipeline import analyze
from rose2_logs.system.workers import Workers

FACTS = {"topic": "/map", "parameters": {"walls": {"a": 0.1}}}
FRAME = 12
"""Bytes of length and checksum before each piece."""


def at(index: int) -> OccupancySnapshot:
    cells, _ = office(resolution_m=0.1)
    return replace(snapshot(cells, 0.1), index=index, log_time_ns=1000 + index)


def work(taken: OccupancySnapshot) -> Found:
    if taken.index == 1:
        return InvalidMapError("map 1 is bad")
    return analyze(taken, Parameters())


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> tuple[bytes, list[int]]:
    """A journal of four maps, and where each of its pieces ends."""
    path = tmp_path_factory.mktemp("journal") / "journal"
    ends = []
    with Journal(path, FACTS) as journal:
        ends.append(path.stat().st_size)
        for index in range(4):
            journal.add(at(index), work(at(index)))
            ends.append(path.stat().st_size)
    return path.read_bytes(), ends


def test_what_was_found_comes_back_in_order(whole, tmp_path: Path):
    (tmp_path / "journal").write_bytes(whole[0])
    kept = kept_maps(tmp_path / "journal")
    assert (kept.facts, kept.maps) == (FACTS, 4)
    with Journal(tmp_path / "journal", FACTS, kept) as journal:
        first, bad, *_ = [journal.known(at(index)) for index in range(4)]
        assert journal.known(at(4)) is None
    assert first.index == 0
    assert np.array_equal(first.rooms.labels, work(at(0)).rooms.labels)
    assert isinstance(bad, InvalidMapError)
    assert str(bad) == "map 1 is bad"


def test_a_tail_that_was_cut_anywhere_costs_one_map(whole, tmp_path: Path):
    """In the length, the checksum, at the beginning, in the middle and just before the end of a piece."""
    data, ends = whole
    path = tmp_path / "journal"
    for number, (begin, end) in enumerate(pairwise(ends)):
        inside = (begin + 1, begin + 7, begin + 8, begin + 11, begin + FRAME, begin + FRAME + 1)
        for cut in (*inside, (begin + end) // 2, end - 1):
            path.write_bytes(data[:cut])
            kept = kept_maps(path)
            assert (kept.maps, kept.end) == (number, begin), cut
        path.write_bytes(data[:end])
        assert kept_maps(path).maps == number + 1


@pytest.mark.parametrize("place", [0, 4, 8, 11, FRAME, FRAME + 20, -1])
def test_what_comes_after_a_damaged_piece_is_dropped(whole, tmp_path: Path, place: int):
    """A bit of the length, the checksum or the content turned; zeros, as a power failure leaves them."""
    data, ends = whole
    path = tmp_path / "journal"
    changed = bytearray(data)
    changed[ends[2] + place if place >= 0 else ends[3] - 1] ^= 0x80
    path.write_bytes(changed)
    assert kept_maps(path).maps == 2
    path.write_bytes(data[: ends[2]] + bytes(5000))
    assert kept_maps(path).maps == 2


def test_a_journal_goes_on_after_its_last_whole_map(whole, tmp_path: Path):
    """What is appended after a cut makes the same file as without it."""
    data, ends = whole
    path = tmp_path / "journal"
    path.write_bytes(data[: ends[2] + 30])
    with Journal(path, FACTS, kept_maps(path)) as journal:
        assert journal.maps == 2
        for index in range(2):
            assert journal.known(at(index)) is not None
        journal.add(at(2), work(at(2)))
    kept = kept_maps(path)
    assert kept.maps == 3
    with Journal(path, FACTS, kept) as journal:
        found = [journal.known(at(index)) for index in range(3)]
    assert found[2].index == 2


@pytest.mark.parametrize("begin", [b"", MAGIC[:5], b"something else", MAGIC, MAGIC + bytes(40)])
def test_what_is_no_journal_is_none(tmp_path: Path, begin: bytes):
    (tmp_path / "journal").write_bytes(begin)
    assert kept_maps(tmp_path / "journal") is None
    assert kept_maps(tmp_path / "nowhere") is None


def test_maps_of_another_log_are_refused(whole, tmp_path: Path):
    path = tmp_path / "journal"
    path.write_bytes(whole[0])
    with (
        Journal(path, FACTS, kept_maps(path)) as journal,
        pytest.raises(OutputError, match="does not fit the log"),
    ):
        journal.known(replace(at(0), log_time_ns=5))


@pytest.mark.parametrize("workers", [1, 2])
def test_only_maps_that_are_not_known_are_analyzed(whole, tmp_path: Path, workers: int):
    """Those that are like the one before are neither analyzed nor kept."""
    data, ends = whole
    path = tmp_path / "journal"
    path.write_bytes(data[: ends[2]])
    with Journal(path, FACTS, kept_maps(path)) as journal, Workers(fail_on_known, workers) as processes:
        same = JournaledWorkers(processes, journal).map(map(at, range(6)), lambda _, now: now.index == 3)
        found = [result if isinstance(result, InvalidMapError) else result.index for _, result in same]
    assert str(found[1]) == "map 1 is bad"
    assert [found[0], *found[2:]] == [0, 2, 2, 4, 5]
    assert kept_maps(path).maps == 5


def fail_on_known(taken: OccupancySnapshot) -> Found:
    assert taken.index > 1
    return work(taken)
