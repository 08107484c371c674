"""Labels of one grid looked up on another: every way of laying them over each other."""

from __future__ import annotations

import dataclasses

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from rose2_logs.model.occupancy import GridGeometry
from rose2_logs.tracking.matching import resample_labels

SHARES = st.floats(-6, 6).map(lambda value: round(value, 2))


@given(
    st.tuples(SHARES, SHARES),
    st.sampled_from([0.5, 1.0, 2.0]),
    st.sampled_from([0.0, 0.3, np.pi / 2, np.pi]),
    st.sampled_from([0.0, 0.3]),
    st.integers(0, 100),
)
@settings(max_examples=60)
def test_each_center_gets_the_label_of_the_cell_that_holds_it(origin, resolution, yaw, source_yaw, seed):
    """As looked up point by point; centers that lie on a border of cells up to rounding are left out."""
    labels = np.random.default_rng(seed).integers(0, 5, (7, 9)).astype(np.int32)
    source = GridGeometry(1.0, (0.25, -0.5), source_yaw, "map", labels.shape)
    target = GridGeometry(resolution, origin, yaw, "map", (8, 6))
    found = resample_labels(labels, source, target)
    rows, columns = np.indices(target.shape)
    in_source = source.world_to_grid(target.cell_centers(rows, columns))
    clear = (np.abs(in_source - np.round(in_source)) > 1e-4).all(axis=-1)
    cells = source.world_to_cell(target.cell_centers(rows, columns))
    inside = ((cells >= 0) & (cells < labels.shape)).all(axis=-1)
    expected = np.where(inside, labels[tuple(np.where(inside[..., None], cells, 0).transpose(2, 0, 1))], 0)
    np.testing.assert_array_equal(found[clear], expected[clear])


def test_a_grid_without_overlap_gets_no_label():
    labels = np.ones((4, 4), np.int32)
    source = GridGeometry(0.05, (0.0, 0.0), 0.0, "map", labels.shape)
    far = dataclasses.replace(source, origin_xy_m=(10.0, 0.0), shape=(3, 5))
    assert not resample_labels(labels, source, far).any()
