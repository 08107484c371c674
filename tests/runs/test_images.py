"""Images packed for the table of maps come back to the last bit; what is none is refused."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
import pytest
import zstandard
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from rose2_logs.config.parameters import OccupancyParameters
from rose2_logs.runs import tables
from rose2_logs.runs.tables import cell_classes, pack_image, unpack_image

IMAGES = st.one_of(
    arrays.arrays(dtype, arrays.array_shapes(min_dims=2, max_dims=2, min_side=0, max_side=40))
    for dtype in ("i1", "<i4")
)


@given(image=IMAGES, turned=st.booleans())
def test_any_image_comes_back(image: np.ndarray, turned: bool):
    """Also an empty one, and one that does not lie row by row in memory."""
    image = image.T if turned else image
    found = unpack_image(pack_image(image), image.shape, image.dtype.str)
    assert found.dtype == image.dtype
    assert np.array_equal(found, image)


@pytest.mark.parametrize("cells_at_once", [1, 7, 100, 2**20])
def test_the_rows_that_are_taken_at_once_do_not_matter(monkeypatch, cells_at_once: int):
    """Neither for what comes back nor for the values that are converted on the way."""
    monkeypatch.setattr(tables, "CELLS_AT_ONCE", cells_at_once)
    image = np.arange(600, dtype="<i4").reshape(30, 20)
    packed = pack_image(image, lambda part: (part * 2).astype("<i4"))
    assert np.array_equal(unpack_image(packed, (30, 20), "<i4"), image * 2)


@given(st.data())
def test_cut_changed_or_other_bytes_are_refused_or_of_the_right_size(data: st.DataObject):
    """There is no checksum: what can be told is that the size is right, and nothing else is raised."""
    packed = pack_image(np.arange(120, dtype="<i4").reshape(10, 12))
    cut = data.draw(st.integers(0, len(packed)))
    at, bits = data.draw(st.integers(0, len(packed) - 1)), data.draw(st.integers(1, 255))
    changed = bytearray(packed)
    changed[at] ^= bits
    for damaged in (packed[:cut], bytes(changed), data.draw(st.binary(max_size=60))):
        with suppress(ValueError):
            assert unpack_image(damaged, (10, 12), "<i4").shape == (10, 12)


@pytest.mark.parametrize("cells", [119, 121, 0])
def test_an_image_of_another_size_is_refused(cells: int):
    with pytest.raises(ValueError, match="does not hold 10 x 12 cells"):
        unpack_image(pack_image(np.zeros((1, cells), "<i4")), (10, 12), "<i4")


def test_what_unpacks_to_far_more_than_the_image_is_not_unpacked_whole():
    """A few kilobytes may claim gigabytes."""
    bomb = zstandard.ZstdCompressor().compress(bytes(2**28))
    assert len(bomb) < 2**16
    with pytest.raises(ValueError, match="does not hold 10 x 12 cells"):
        unpack_image(bomb, (10, 12), "i1")


def test_classes_are_those_of_the_thresholds():
    cells = np.array([[-1, 0, 19, 20, 50, 65, 66, 100]], np.int8)
    assert cell_classes(cells, OccupancyParameters()).tolist() == [[-1, 0, 0, 50, 50, 50, 100, 100]]
