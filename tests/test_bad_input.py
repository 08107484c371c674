"""What cannot be used ends in one line of a known error, at once, whatever it is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rose2_logs as rl

OFFICE = str(Path(__file__).parents[1] / "sample_logs" / "office.mcap")
GRID = np.zeros((20, 20), np.int8)


class Three:
    """A sink by its three methods alone."""

    def __init__(self) -> None:
        self.calls: list[str] = []

    def begin(self, info):
        self.calls.append("begin")

    def write(self, step):
        self.calls.append("write")

    def finish(self, summary):
        self.calls.append("finish")


BAD = {
    "no cells": lambda: rl.segment(np.zeros((0, 0), np.int8), resolution_m=0.05),
    "no columns": lambda: rl.segment(np.zeros((5, 0), np.int8), resolution_m=0.05),
    "one dimension": lambda: rl.segment(np.zeros(9, np.int8), resolution_m=0.05),
    "rows of different lengths": lambda: rl.segment([[0, 0], [0]], resolution_m=0.05),
    "probabilities": lambda: rl.segment(GRID.astype(float), resolution_m=0.05),
    "truth values": lambda: rl.segment(GRID > 0, resolution_m=0.05),
    "101 %": lambda: rl.segment(np.full((9, 9), 101), resolution_m=0.05),
    "-2": lambda: rl.segment(np.full((9, 9), -2), resolution_m=0.05),
    "no map": lambda: rl.segment(None),
    "a path of bytes": lambda: rl.segment(b"map.yaml"),
    "no resolution": lambda: rl.segment(GRID),
    "resolution as text": lambda: rl.segment(GRID, resolution_m="0.05"),
    "resolution as list": lambda: rl.segment(GRID, resolution_m=[0.05]),
    "resolution True": lambda: rl.segment(GRID, resolution_m=True),
    "resolution nan": lambda: rl.segment(GRID, resolution_m=float("nan")),
    "resolution of an image as text": lambda: rl.read_map("map.pgm", "0.05"),
    "unknown method": lambda: rl.segment(GRID, resolution_m=0.05, method="rose3"),
    "unknown parameter": lambda: rl.segment(GRID, resolution_m=0.05, parameters={"walls.extensio_m": 6}),
    "infinite parameter": lambda: rl.segment(
        GRID, resolution_m=0.05, parameters={"walls.extension_m": np.inf}
    ),
    "unknown option": lambda: rl.analyze(OFFICE, workrs=2),
    "unknown option of a log": lambda: rl.open_log(OFFICE, foo=1),
    "seconds as text": lambda: rl.open_log(OFFICE, every_s="1"),
    "half a map": lambda: rl.open_log(OFFICE, max_snapshots=1.5),
    "True maps": lambda: rl.open_log(OFFICE, max_snapshots=True),
    "an end before the start": lambda: rl.open_log(OFFICE, start_s=5, end_s=1),
    "a topic by number": lambda: rl.open_log(OFFICE, topic=3),
    "a topic by number, analyzed": lambda: rl.analyze(OFFICE, topic=3),
    "yes": lambda: rl.RunOptions(recording="yes"),
    "one sink for a list": lambda: rl.analyze(OFFICE, sinks=3),
    "a number for a sink": lambda: rl.analyze(OFFICE, sinks=[3]),
    "a class for a sink": lambda: rl.analyze(OFFICE, sinks=[Three]),
    "a sink that does nothing": lambda: rl.analyze(OFFICE, sinks=[rl.Sink()]),
    "a number to call": lambda: rl.analyze(OFFICE, on_snapshot=3),
    "a number for a log": lambda: rl.track(3),
    "a list of logs": lambda: rl.analyze([OFFICE]),
    "a log of bytes": lambda: rl.open_log(b"x"),
    "no log": lambda: rl.analyze(None),
    "no such log": lambda: rl.track("nowhere.mcap"),
    "paths for maps": lambda: list(rl.track([OFFICE])),
    "a number for a folder": lambda: rl.analyze(OFFICE, out=3),
    "nothing for a folder": lambda: rl.analyze(OFFICE, out=""),
    "nothing to load": lambda: rl.load(""),
    "None to load": lambda: rl.load(None),
    "None to compare": lambda: rl.compare(None, None),
    "None to evaluate": lambda: rl.evaluate(None),
    "a resolution that is none": lambda: rl.GridGeometry("a", (0, 0), 0, "map", (2, 2)),
    "an origin that is none": lambda: rl.GridGeometry(0.05, 0, 0, "map", (2, 2)),
    "a geometry that is none": lambda: rl.OccupancySnapshot(0, 0, 0, "/map", GRID, None),
}


@pytest.mark.parametrize("what", BAD)
def test_what_cannot_be_used_is_one_line_that_names_no_flag(what: str):
    with pytest.raises(rl.Rose2LogsError) as caught:
        BAD[what]()
    text = str(caught.value)
    assert text
    assert "\n" not in text
    assert "--" not in text


def test_a_sink_needs_but_its_three_methods():
    sink = Three()
    rl.analyze(OFFICE, sinks=[sink], max_snapshots=2)
    assert sink.calls == ["begin", "write", "write", "finish"]


def test_cells_under_a_mask_are_unknown():
    hidden = np.zeros(GRID.shape, bool)
    hidden[:, 10:] = True
    found = rl.segment(np.ma.MaskedArray(GRID, hidden), resolution_m=0.05)
    assert (found.snapshot.cells[:, 10:] == -1).all()
    assert (found.snapshot.cells[:, :10] == 0).all()
