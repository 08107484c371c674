"""Numbers as people read them, and tables of them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import UTC, datetime

from rose2_logs.drawing.palette import track_color
from rose2_logs.model.room_names import NameOf, room_name
from rose2_logs.system.text import percent

CLOCK_FROM_NS = 10**18
"""Log times before September 2001 come from a simulator's clock or none at all; they are no dates."""
MISSING = "–"


@dataclass(frozen=True)
class Cell:
    """One cell of a table.

    Attributes
    ----------
    text : str
        What it shows.
    order : float, str or None
        What it is sorted by; by default its text, None for a missing value.
    color : str
        CSS color of a sample before the text; empty for none.
    """

    text: str
    order: float | str | None = None
    color: str = ""


@dataclass(frozen=True)
class Column:
    """Heading of a column, what it means, and whether its values are numbers."""

    heading: str
    meaning: str = ""
    is_number: bool = True


@dataclass(frozen=True)
class Table:
    """A table that can be sorted by each of its columns.

    Attributes
    ----------
    name : str
        For its caption.
    columns : tuple of Column
    rows : tuple of tuples of Cell
    note : str
        What was left out; empty for nothing.
    """

    name: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]
    note: str = ""


def number(value: float | None, decimals: int = 1, unit: str = "") -> Cell:
    """Cell of a number; None and NaN are missing."""
    if value is None or not math.isfinite(value):
        return Cell(MISSING)
    return Cell(f"{value:.{decimals}f}{unit}", value)


def share(value: float | None) -> Cell:
    """Cell of a share, in percent."""
    if value is None or not math.isfinite(value):
        return Cell(MISSING)
    return Cell(percent(value), 100 * value)


def count(value: int) -> Cell:
    """Cell of a whole number."""
    return Cell(str(value), float(value))


def when(seconds: float | None) -> Cell:
    """Cell of a time since the first map."""
    return (
        Cell(MISSING) if seconds is None or not math.isfinite(seconds) else Cell(duration(seconds), seconds)
    )


def room(track: int, name_of: NameOf = room_name) -> Cell:
    """Cell of a room, with its color."""
    return Cell(name_of(track), float(track), css_color(track))


def css_color(track: int) -> str:
    """Color of a track as CSS has it."""
    return css(track_color(track))


def css(color: tuple[int, int, int]) -> str:
    """Color, its red, green and blue in 0..255, as CSS has it."""
    return "#{:02x}{:02x}{:02x}".format(*color)


def duration(seconds: float) -> str:
    """Time span in the units that fit."""
    if seconds < 60:
        return f"{seconds:.3g} s"
    minutes, rest = divmod(round(seconds), 60)
    if minutes < 60:
        return f"{minutes} min {rest} s"
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes} min"


def date_of(log_time_ns: int | None) -> str | None:
    """Date and time, None for log times that are none."""
    if log_time_ns is None or log_time_ns < CLOCK_FROM_NS:
        return None
    return datetime.fromtimestamp(log_time_ns / 1e9, UTC).strftime("%Y-%m-%d %H:%M:%S UTC")


def size(size_bytes: float) -> str:
    """Size of a file."""
    for unit, factor in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if size_bytes >= factor:
            return f"{size_bytes / factor:.1f} {unit}"
    return f"{size_bytes:.0f} bytes"
