"""Shares in percent, as people read them."""

from __future__ import annotations


def percent(share: float, unit: str = "%") -> str:
    """Tell a share in whole percent; what is not yet the whole is never told as 100 %.

    Parameters
    ----------
    share : float
        1 is the whole.
    unit : str
        What stands behind the number.
    """
    text = f"{100 * share:.0f}"
    if share < 1 and text == "100":
        text = f"{min(100 * share, 99.9):.1f}"
    return text + unit
