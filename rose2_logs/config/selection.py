"""Which maps of a log to take, decided from message times before anything is decoded."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rose2_logs.errors import ParameterError

Times = NDArray[np.int64]


@dataclass(frozen=True)
class Selection:
    """Which maps of a log to take; without arguments all of them.

    All but `min_change_m2` is decided from message times, so that what is not taken is not decoded either.

    Attributes
    ----------
    start_ns, end_ns : int, optional
        First and last log time to take, both inclusive, nanoseconds since the epoch.
    every_s : float, optional
        Least time between two taken messages, seconds; the first one is taken.
    min_change_m2 : float, optional
        Least area that became known, or unknown again, since the last taken map, square meters.
    max_snapshots : int, optional
        Most messages to take, spread evenly over those that are left; the first and the last one stay in
        (of 1, the last one stays).

    Raises
    ------
    ParameterError
        If a number makes no sense.
    """

    start_ns: int | None = None
    end_ns: int | None = None
    every_s: float | None = None
    min_change_m2: float | None = None
    max_snapshots: int | None = None

    def __post_init__(self) -> None:
        if self.start_ns is not None and self.end_ns is not None and self.start_ns > self.end_ns:
            raise ParameterError(
                f"the time range starts at {self.start_ns} ns, after its end at {self.end_ns} ns"
            )
        for what, value in (("time between snapshots", self.every_s), ("map change", self.min_change_m2)):
            if value is not None and not (np.isfinite(value) and value >= 0):
                raise ParameterError(f"the least {what} must be 0 or more, not {value}")
        if self.max_snapshots is not None and self.max_snapshots < 1:
            raise ParameterError(f"the most snapshots to take must be 1 or more, not {self.max_snapshots}")

    def in_range(self, times: Times) -> Times:
        """Keep those of the sorted `times` that lie in the time range."""
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
