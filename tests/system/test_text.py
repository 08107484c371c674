"""Shares as people read them."""

from __future__ import annotations

import pytest

from rose2_logs.system.text import percent


@pytest.mark.parametrize(
    ("share", "text"),
    [
        (0.0, "0%"),
        (0.124, "12%"),
        (0.9949, "99%"),
        (0.996, "99.6%"),
        (0.99999, "99.9%"),
        (1.0, "100%"),
        (1.18, "118%"),
    ],
)
def test_what_is_not_whole_is_never_told_as_all_of_it(share: float, text: str):
    """A layout that was final from 99.6 % coverage on was not final from 100 % on."""
    assert percent(share) == text


def test_the_unit_stands_as_it_is_asked_for():
    assert percent(0.5, " %") == "50 %"
