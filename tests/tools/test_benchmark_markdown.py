"""Numbers and tables of the report."""

from __future__ import annotations

from rose2_logs.evaluation.scores import Scores


def test_differences_carry_their_sign_and_zero_none():
    from benchmarking.markdown import difference

    assert [difference(value) for value in (1.26, -1.26, 0.04, -0.04)] == ["+1.3", "−1.3", "0.0", "0.0"]


def test_a_table_has_as_many_columns_in_every_line_and_bars_are_escaped():
    from benchmarking.markdown import table

    lines = table(["a", "b"], [["x|y", "1"]])
    assert lines == ["| a | b |", "| --- | ---: |", "| x\\|y | 1 |", ""]


def test_unknown_figures_stay_empty():
    from benchmarking.markdown import bold, figures_of, rooms_of

    scores = Scores(1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.5, 8.0)
    assert figures_of(scores, ["iou_seg", "pq"]) == ["3.0", "6.0"]
    assert figures_of({"iou_seg": 3.0}, ["iou_seg", "pq"]) == ["3.0", ""]
    assert rooms_of(scores) == "7.5/8"
    assert [bold("1.0"), bold("1.0", False), bold("")] == ["**1.0**", "1.0", ""]
