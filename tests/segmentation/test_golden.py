"""Rooms of drawn and simulated maps are those that were kept; tools/make_golden_maps.py makes them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from drawn_maps import snapshot
from numpy.typing import NDArray

from rose2_logs.config.parameters import Parameters
from rose2_logs.segmentation.pipeline import analyze

GOLDEN = sorted(Path(__file__).with_name("golden").glob("*.npz"))
MOST_DIFFERENCE = 0.01
"""Share of the cells of rooms: versions of OpenCV and SciPy differ in some cells at borders."""


def numbered_as(kept: NDArray[np.integer], found: NDArray[np.integer]) -> NDArray[np.integer]:
    """Give each room that is found the number of the kept room that holds most of it, 0 for none."""
    common = np.zeros((found.max() + 1, kept.max() + 1), int)
    np.add.at(common, (found, kept), 1)
    common[0] = common[:, 0] = 0
    return common.argmax(1)[found]


@pytest.mark.parametrize("grouping", ["fitted", "walls"])
@pytest.mark.parametrize("path", GOLDEN, ids=lambda path: path.stem)
def test_a_map_has_the_rooms_that_were_kept(path: Path, grouping: str):
    """Whatever their numbers are."""
    with np.load(path) as file:
        cells, resolution_m, kept = file["cells"], float(file["resolution_m"]), file[grouping]
    parameters = Parameters.from_any({"floor_plan.grouping": grouping})
    found = analyze(snapshot(cells, resolution_m), parameters).rooms.labels
    differing = (numbered_as(kept, found) != kept).sum() / (kept > 0).sum()
    assert found.max() == kept.max()
    assert differing <= MOST_DIFFERENCE


def test_there_are_maps():
    assert len(GOLDEN) == 12
