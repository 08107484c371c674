"""Layers of a recording: logged on every timeline, and only where they change."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import rerun as rr


@dataclass(frozen=True)
class Instant:
    """Where a snapshot stands on each timeline.

    Attributes
    ----------
    message_log_time_ns, ros2_timestamp_ns : int
        On timelines named as those of Rerun's own MCAP importer.
    snapshot : int
        Its number.
    coverage : int
        In steps of `COVERAGE_UNIT`.
    """

    message_log_time_ns: int
    ros2_timestamp_ns: int
    snapshot: int
    coverage: int

    def set(self, recording: rr.RecordingStream) -> None:
        """Give what is logged next these times."""
        recording.set_time("message_log_time", timestamp=np.datetime64(self.message_log_time_ns, "ns"))
        recording.set_time("ros2_timestamp", timestamp=np.datetime64(self.ros2_timestamp_ns, "ns"))
        recording.set_time("snapshot", sequence=self.snapshot)
        recording.set_time("coverage", sequence=self.coverage)

    def columns(self) -> list[rr.TimeColumn]:
        """Return the times as columns of one row."""
        stamps = np.array([self.message_log_time_ns, self.ros2_timestamp_ns]).astype("datetime64[ns]")
        return [
            rr.TimeColumn("message_log_time", timestamp=stamps[:1]),
            rr.TimeColumn("ros2_timestamp", timestamp=stamps[1:]),
            rr.TimeColumn("snapshot", sequence=[self.snapshot]),
            rr.TimeColumn("coverage", sequence=[self.coverage]),
        ]


@dataclass(frozen=True)
class _Layer:
    """What a path shows, and in which stretch of the run it was logged."""

    content: list[rr.DescribedComponentBatch]
    stretch: int


class ChangedLayers:
    """Logs a layer only where it differs from what its path shows already.

    At any place of a timeline a viewer shows what was logged last before it on that timeline, so that what
    has not changed can be left out as long as the timelines go forward. A snapshot that covers less than
    one before it stands on the coverage timeline at the greatest coverage so far, behind the other. Stamps
    that go back begin a new stretch of the run, in which everything is logged again.

    Parameters
    ----------
    recording : RecordingStream
        Where to.

    Attributes
    ----------
    picture_bytes : int
        Of the pictures logged so far; may be set.
    """

    def __init__(self, recording: rr.RecordingStream) -> None:
        self.picture_bytes = 0
        self._recording = recording
        self._layers: dict[str, _Layer] = {}
        self._stretch = 0
        self._stamps_went_back = False
        self._now = Instant(0, 0, 0, 0)
        self._latest_stamp_ns: int | None = None

    def begin(self, log_time_ns: int, stamp_ns: int, snapshot: int, coverage: int) -> None:
        """Start a snapshot: everything is logged at these times from now on."""
        latest_ns = stamp_ns if self._latest_stamp_ns is None else self._latest_stamp_ns
        goes_back = stamp_ns < latest_ns
        if goes_back or self._stamps_went_back:
            self._stretch += 1
        self._stamps_went_back, self._latest_stamp_ns = goes_back, max(stamp_ns, latest_ns)
        self._now = Instant(log_time_ns, stamp_ns, snapshot, max(coverage, self._now.coverage))
        self._now.set(self._recording)

    def log(self, path: str, archetype: rr.AsComponents) -> None:
        """Log a layer at the present snapshot if it has changed."""
        content = list(archetype.as_component_batches())
        if self._has_changed(path, content):
            self._recording.log(path, content)

    def log_picture(self, path: str, archetype: rr.AsComponents) -> None:
        """Log a large layer if it has changed; it goes to the file at once and does not wait for others."""
        content = list(archetype.as_component_batches())
        if self._has_changed(path, content):
            columns = [batch.partition([len(batch.as_arrow_array())]) for batch in content]
            self._recording.send_columns(path, self._now.columns(), columns)
            self.picture_bytes += sum(batch.as_arrow_array().nbytes for batch in content)

    def clear(self, path: str) -> None:
        """Show nothing under a path and what lies below from the present snapshot on."""
        for known in [each for each in self._layers if each == path or each.startswith(f"{path}/")]:
            del self._layers[known]
        self._recording.log(path, rr.Clear(recursive=True))

    def _has_changed(self, path: str, content: list[rr.DescribedComponentBatch]) -> bool:
        """Whether a path shows something else, and take down what it shows now."""
        shown = self._layers.get(path)
        if shown is not None and shown.stretch == self._stretch and _equal(content, shown.content):
            return False
        self._layers[path] = _Layer(content, self._stretch)
        return True


def _equal(some: list[rr.DescribedComponentBatch], others: list[rr.DescribedComponentBatch]) -> bool:
    return len(some) == len(others) and all(
        one.component_descriptor() == other.component_descriptor()
        and one.as_arrow_array().equals(other.as_arrow_array())
        for one, other in zip(some, others, strict=True)
    )
