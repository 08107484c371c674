"""Wall cells in the order of strips and of their place along these."""

import numpy as np
import pytest

from rose2_logs.segmentation.walls.strips import SortedCells


@pytest.mark.parametrize("angle_rad", [0.0, 0.3, np.pi / 4, np.pi / 2, 3 * np.pi / 4, 1e-13, 1e-8])
def test_cells_are_in_the_order_of_strip_place_and_number_however_close_they_are(angle_rad):
    """Along 45 degrees, cells of a strip are at one place but for rounding; far from the origin the more."""
    draw = np.random.default_rng(1)
    row, column = np.divmod(np.sort(draw.choice(200 * 300, 9000, replace=False)), 300)
    points = np.stack([column * 0.05 + 1000.025, row * 0.05 + 3000.025])
    directions = np.array([angle_rad, 1.0])
    cells = SortedCells.of(points, directions, 0.05)
    for number, direction in enumerate(directions):
        c, s = np.cos(direction), np.sin(direction)
        along, across = points[0] * c + points[1] * s, points[1] * c - points[0] * s
        for shift in (0, 1):
            strip = (np.floor(across / 0.05).astype(int) + shift) >> 1
            slot, place, key = (
                values[shift].reshape(2, -1)[number] for values in (cells.slot, cells.along, cells.key)
            )
            expected = np.lexsort((np.arange(9000), along, strip))
            np.testing.assert_array_equal(slot - number * 9000, expected)
            np.testing.assert_array_equal(place, along[expected])
            found = key - number * cells.span[shift] + cells.first_strip[shift][number]
            np.testing.assert_array_equal(found, strip[expected])
