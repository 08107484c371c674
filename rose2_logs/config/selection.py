"""Which maps of a log to take, decided from message times before anything is decoded."""

from __future__ import annotations

import dataclasses
import sys
from dataclasses import dataclass
from numbers import Integral, Real

import numpy as np
from numpy.typing import NDArray

from rose2_logs.config.fields import changed_text
from rose2_logs.config.times import LATEST_NS, LONGEST_LOG_S
from rose2_logs.errors import ParameterError

Times = NDArray[np.int64]
LARGEST = sys.float_info.max
"""Whole numbers can be larger, but are no float then."""


def _is_number(value: object, kind: type) -> bool:
    return isinstance(value, kind) and not isinstance(value, bool | np.bool_)


@dataclass(frozen=True)
class Selection:
    """Which maps of a log to take; by default all of them.

    All but `min_change_m2` is decided from message times, so that what is not taken is not decoded either.

    Attributes
    ----------
    start_ns, end_ns : int, optional
        First and last log time to take, both inclusive, nanoseconds since the epoch.
    every_s : float, optional
        Minimum time between two taken messages, seconds; the first one is taken.
    min_change_m2 : float, optional
        Minimum area, square meters, that changed between known and unknown since the last taken map.
    max_snapshots : int, optional
        Maximum number of messages, evenly spaced over those that are left; the first and the last one are
        among them (of 1, it is the last one).
    start_s, end_s : float, optional
        The time range in seconds since the log's first message, in place of `start_ns` and `end_ns`.

    Raises
    ------
    ParameterError
        If a number makes no sense.

    Examples
    --------
    >>> import numpy as np, rose2_logs as rl
    >>> rl.Selection(max_snapshots=3).thin(np.arange(10))
    array([0, 4, 9])
    """

    start_ns: int | None = None
    end_ns: int | None = None
    every_s: float | None = None
    min_change_m2: float | None = None
    max_snapshots: int | None = None
    start_s: float | None = None
    end_s: float | None = None

    def __repr__(self) -> str:
        return changed_text(self)

    def __post_init__(self) -> None:
        for name in ("every_s", "min_change_m2"):
            value = getattr(self, name)
            if value is not None and not (_is_number(value, Real) and 0 <= value <= LARGEST):
                raise ParameterError(f"{name}={value!r}: it must be a number, 0 or more")
        for name in ("start_s", "end_s"):
            value = getattr(self, name)
            if value is not None and not (_is_number(value, Real) and 0 <= value <= LONGEST_LOG_S):
                raise ParameterError(f"{name}={value!r}: it must be a number, 0 to {LONGEST_LOG_S:g}")
        for name in ("start_ns", "end_ns"):
            value = getattr(self, name)
            if value is not None and not (_is_number(value, Integral) and 0 <= value <= LATEST_NS):
                raise ParameterError(
                    f"{name}={value!r}: it must be a whole number of nanoseconds, 0 to {LATEST_NS}"
                )
        if self.start_ns is not None and self.end_ns is not None and self.start_ns > self.end_ns:
            raise ParameterError(
                f"the time range starts at {self.start_ns} ns, after its end at {self.end_ns} ns"
            )
        if self.start_s is not None and self.end_s is not None and self.start_s > self.end_s:
            raise ParameterError(f"start_s={self.start_s:g}: it lies after end_s={self.end_s:g}")
        most = self.max_snapshots
        if most is not None and not (_is_number(most, Integral) and most >= 1):
            raise ParameterError(f"max_snapshots={most!r}: it must be a whole number, 1 or more")

    def since(self, first_ns: int | None) -> Selection:
        """Return the same with a time range in log times, for a log whose first message is of `first_ns`."""
        begin_ns = first_ns or 0
        start_ns = self.start_ns if self.start_s is None else _after(begin_ns, self.start_s)
        end_ns = self.end_ns if self.end_s is None else _after(begin_ns, self.end_s)
        return dataclasses.replace(self, start_ns=start_ns, end_ns=end_ns, start_s=None, end_s=None)

    def in_range(self, times: Times) -> Times:
        """Keep those of the sorted `times` that are within the time range."""
        first = 0 if self.start_ns is None else int(np.searchsorted(times, self.start_ns, "left"))
        stop = len(times) if self.end_ns is None else int(np.searchsorted(times, self.end_ns, "right"))
        return times[first:stop]

    def thin(self, times: Times) -> Times:
        """Keep those of the sorted, distinct `times` that `every_s` and `max_snapshots` choose."""
        if self.every_s and len(times):
            times = times[self._every(times, self.every_s * 1e9)]
        if self.max_snapshots == 1:
            return times[-1:]
        if self.max_snapshots is not None and len(times) > self.max_snapshots:
            times = times[np.linspace(0, len(times) - 1, self.max_snapshots).round().astype(np.intp)]
        return times

    @staticmethod
    def _every(times: Times, least_ns: float) -> list[int]:
        """Places of the first time, and of each that follows the one before by at least so much."""
        chosen = [0]
        if least_ns <= int(times[-1]) - int(times[0]):  # beyond, it may be more than a log time can be
            step = max(round(least_ns), 1)
            while (later := int(np.searchsorted(times, int(times[chosen[-1]]) + step))) < len(times):
                chosen.append(later)
        return chosen


def _after(begin_ns: int, time_s: float) -> int:
    """Log time so many seconds after another, or the latest one that there can be."""
    return min(begin_ns + round(time_s * 1e9), LATEST_NS)
