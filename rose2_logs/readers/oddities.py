"""What is odd about maps that can be read all the same, from one to the next."""

from __future__ import annotations

from rose2_logs.readers.messages import Grid, Patch, Remark

BACK_NS = 10**9
"""Stamps may go back by the time that maps wait for each other; by more, a clock was set."""


class Oddities:
    """Looks at the maps of a topic as they come."""

    def __init__(self) -> None:
        self._stamp_ns: int | None = None
        self._frame: str | None = None

    def of(self, message: Grid | Patch | None, log_time_ns: int) -> tuple[Remark, ...]:
        """Tell what is odd about a map or a patch with its log time, and what changed since the last one."""
        if message is None:
            return (Remark("no_cells", "a map without cells; left out"),)
        remarks = list(message.remarks)
        before, self._stamp_ns = self._stamp_ns, message.stamp_ns
        # Of what carries no time at all, as saved maps, that is known.
        if message.stamp_ns == 0 and log_time_ns != 0:
            remarks.append(Remark("stamp_zero", "its stamp is zero; only its log time is known"))
        elif before is not None and message.stamp_ns < before - BACK_NS:
            remarks.append(
                Remark("stamp_back", f"its stamp goes back by {(before - message.stamp_ns) / 1e9:.1f} s")
            )
        if isinstance(message, Grid):
            frame, self._frame = self._frame, message.geometry.frame_id
            if frame is not None and frame != self._frame:
                text = (
                    f"its frame changes from {frame!r} to {self._frame!r}; rooms are followed by coordinates"
                )
                remarks.append(Remark("frame_changes", text))
        return tuple(remarks)
