"""What Hypothesis makes of grids, patches and logs, whole and damaged: maps or known errors come out."""

from __future__ import annotations

import functools
import tempfile
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from faulty_logs import START_NS, Grid, Input, Logged, Patch, packed, write_bag, write_mcap, write_rosbag2
from fuzzing.targets import FRAME_BYTES, TARGETS
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.writer import CompressionType

from rose2_logs.io import open_log

BUDGET = settings(max_examples=50, derandomize=True)
"""Small and the same each time; tools/fuzz.py is for long runs."""
NUMBERS = st.floats(width=32) | st.sampled_from([0.05, 0.0, -0.05, 1e9, float("nan"), float("inf")])
SIZES = st.integers(0, 6) | st.sampled_from([2**16, 2**31, 2**32 - 1])

cells = st.builds(
    lambda height, width, seed: np.random.default_rng(seed).integers(-1, 101, (height, width), np.int8),
    st.integers(1, 6),
    st.integers(1, 6),
    st.integers(0, 99),
)
whole_grids = st.builds(
    lambda cells, x, y, stamp: Grid(
        cells.tobytes(), cells.shape[1], cells.shape[0], 0.05, (x, y, 0.0, 0.0, 0.0, 0.0, 1.0), "map", stamp
    ),
    cells,
    st.floats(-100, 100),
    st.floats(-100, 100),
    st.integers(0, 2**32 * 10**9 - 1),
)
any_grids = st.builds(
    Grid,
    st.binary(max_size=36),
    SIZES,
    SIZES,
    NUMBERS,
    st.tuples(*[NUMBERS] * 7),
    st.text(st.characters(exclude_categories=["Cs"]), max_size=5),
)
patches = st.builds(
    lambda cells, x, y: Patch(cells.tobytes(), x, y, cells.shape[1], cells.shape[0]),
    cells,
    st.integers(-2, 6) | st.sampled_from([-(2**31), 2**31 - 1]),
    st.integers(-2, 6),
)


def logs(grids):
    """Messages on a map's topic and that of its patches, a second apart."""
    kinds = grids.map(lambda grid: ("/map", grid)) | patches.map(lambda patch: ("/map_updates", patch))
    return st.lists(kinds, min_size=1, max_size=5).map(
        lambda messages: [
            (topic, START_NS + k * 10**9, message) for k, (topic, message) in enumerate(messages)
        ]
    )


def patched(logged: list[Logged]) -> list[np.ndarray]:
    """Maps as they stand after each message, by a slow and plain way."""
    states, now = [], None
    for _, _, message in logged:
        made = np.frombuffer(message.data, np.int8).reshape(message.height, message.width)
        if isinstance(message, Grid):
            now = made
        elif now is not None:
            rows, columns = (
                range(message.y, message.y + made.shape[0]),
                range(message.x, message.x + made.shape[1]),
            )
            if rows[0] >= 0 and columns[0] >= 0 and rows[-1] < now.shape[0] and columns[-1] < now.shape[1]:
                now = now.copy()
                now[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1] = made
        if now is not None:
            states.append(now)
    return states


WRITERS = {
    "mcap": Input("mcap", functools.partial(write_mcap, compression=CompressionType.NONE), ".mcap"),
    "bag": Input("bag", write_bag, ".bag"),
    "sqlite": Input("sqlite", write_rosbag2, ""),
}


@functools.cache
def written(target: str) -> bytes:
    """A whole log of a few maps and patches, small, so that much of it is hit."""
    logged: list[Logged] = []
    for k in range(3):
        made = np.full((4, 5), 50 * (k % 3), np.int8)
        logged.append(("/map", START_NS + 2 * k * 10**9, Grid(made.tobytes(), 5, 4)))
        logged.append(("/map_updates", START_NS + (2 * k + 1) * 10**9, Patch(bytes([1, 2]), k, 1, 2, 1)))
    with tempfile.TemporaryDirectory() as folder:
        kind = WRITERS[target]
        return kind.data_file(kind.make(Path(folder), logged)).read_bytes()


damage = st.tuples(
    st.lists(st.tuples(st.floats(0, 1, exclude_max=True), st.integers(1, 255)), max_size=8),
    st.just(1.0) | st.floats(0, 1),
)
"""Bytes that are changed, as places in [0, 1) and what to change, and where the file ends."""


def damaged(data: bytes, flips, end: float) -> bytes:
    changed = bytearray(data)
    for place, bits in flips:
        changed[int(place * len(data))] ^= bits
    return bytes(changed[: round(end * len(data))])


@pytest.mark.parametrize("target", WRITERS)
@BUDGET
@given(damage=damage)
def test_a_log_with_changed_and_missing_bytes_gives_maps_or_a_known_error(target, damage):
    TARGETS[target](damaged(written(target), *damage))


@pytest.mark.parametrize("target", WRITERS)
@settings(BUDGET, max_examples=12)
@given(logged=logs(whole_grids))
def test_grids_and_patches_of_any_kind_give_the_maps_that_they_make(target, logged):
    states = patched(logged)
    with tempfile.TemporaryDirectory() as folder:
        log = WRITERS[target].make(Path(folder), logged)
        if not any(topic == "/map" for topic, _, _ in logged):
            return
        with open_log(log) as reader:
            read = [each.cells for each in reader.snapshots()]
    # A map that equals the one before, in its place too, is no new one; here only the cells are known.
    expected = [states[0]] + [now for before, now in pairwise(states) if not np.array_equal(before, now)]
    made = [read[0]] + [now for before, now in pairwise(read) if not np.array_equal(before, now)]
    assert [each.tolist() for each in made] == [each.tolist() for each in expected]


@settings(BUDGET, max_examples=150)
@given(
    messages=st.lists(
        st.tuples(any_grids | whole_grids | patches, st.sampled_from(["cdr", "ros1"])), max_size=5
    )
)
def test_claims_of_any_kind_give_maps_or_known_errors(messages):
    framed = b""
    for message, encoding in messages:
        data = packed(message, encoding)
        kind = (0 if encoding == "cdr" else 2) + isinstance(message, Patch)
        framed += bytes([kind]) + len(data).to_bytes(FRAME_BYTES - 1, "little") + data
    TARGETS["updates"](framed)


@settings(BUDGET, max_examples=100)
@given(data=st.binary(max_size=200), target=st.sampled_from(sorted(TARGETS)))
def test_any_bytes_give_a_known_error(data, target):
    TARGETS[target](data)
