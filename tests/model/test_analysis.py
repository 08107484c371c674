"""What was left out of a map is told where it is much."""

from __future__ import annotations

import pytest

from rose2_logs.model.analysis import LEFT_OUT_TOLD, left_out_note


@pytest.mark.parametrize(
    ("outside_m2", "free_m2", "told"),
    [(0.0, 0.0, False), (0.0, 50.0, False), (99 * LEFT_OUT_TOLD, 100.0, False), (25.0, 100.0, True)],
)
def test_much_that_was_left_out_is_told_with_a_remedy(outside_m2: float, free_m2: float, told: bool):
    note = left_out_note(outside_m2, free_m2)
    assert (note is not None) is told
    if note is not None:
        assert note.startswith("25 m2 of free floor, 25%,")
        assert "regions.outside_max_share=0" in note
