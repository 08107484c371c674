"""Numbers as text."""

from __future__ import annotations

from collections.abc import Sequence


def percent(share: float, unit: str = "%") -> str:
    """Format a share in whole percent; anything less than the whole is never shown as 100 %.

    Parameters
    ----------
    share : float
        1 is the whole.
    unit : str
        Text after the number.

    Examples
    --------
    >>> percent(0.256)
    '26%'
    >>> percent(0.9999)
    '99.9%'
    """
    text = f"{100 * share:.0f}"
    if share < 1 and text == "100":
        text = f"{min(100 * share, 99.9):.1f}"
    return text + unit


def counted(number: int, noun: str) -> str:
    """Return how many there are of something.

    Examples
    --------
    >>> counted(1, "room"), counted(2, "room")
    ('1 room', '2 rooms')
    """
    return f"{number} {noun}{'' if number == 1 else 's'}"


def listed(names: Sequence[str], most: int) -> str:
    """Return the first of some names, at most so many, and how many more there are.

    Examples
    --------
    >>> listed(["a", "b"], most=2), listed(["a", "b", "c", "d"], most=2)
    ('a, b', 'a, b and 2 more')
    """
    more = len(names) - most
    return ", ".join(names[:most]) + (f" and {more} more" if more > 0 else "")


def apart(nanoseconds: int) -> str:
    """Return how long something lasts, in seconds or, from a year on, in years.

    Examples
    --------
    >>> apart(114_000_000_000), apart(1_700_000_000_000_000_000)
    ('114.0 s', '53.9 years')
    """
    seconds = nanoseconds / 1e9
    years = seconds / (365.25 * 86400)
    return f"{seconds:.1f} s" if years < 1 else f"{years:.1f} years"
