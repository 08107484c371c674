"""``summary.json``: what a run was made of and what came out, for people and scripts."""

from __future__ import annotations

import dataclasses
import json
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import Any

from rose2_logs.runs.sink import RunInfo
from rose2_logs.system.files import replacing
from rose2_logs.tracking.convergence import Convergence
from rose2_logs.tracking.track_history import TrackHistories
from rose2_logs.tracking.tracked_snapshot import TrackedSnapshot


@dataclass
class RunningMean:
    """Mean and maximum of values that come one by one; None counts as no value."""

    count: int = 0
    total: float = 0.0
    maximum: float | None = None

    def add(self, value: float | None) -> None:
        """Take a value."""
        if value is not None:
            self.count += 1
            self.total += value
            self.maximum = value if self.maximum is None else max(self.maximum, value)

    @property
    def mean(self) -> float | None:
        """Mean of the values so far, None without any."""
        return self.total / self.count if self.count else None


@dataclass
class RunTotals:
    """What is summed up over a run, snapshot by snapshot.

    Attributes
    ----------
    snapshots : int
        Maps that were analyzed.
    invalid : int
        Maps that could not be analyzed and were left out.
    unchanged : int
        Maps with the free and occupied cells of the one before, whose analysis was taken over.
    rooms_last : int
        Rooms of the last snapshot.
    tracks : int
        Rooms that ever had a number.
    coverage_first, coverage_last : float
        Of the first and the last snapshot.
    first_log_time_ns, last_log_time_ns : int or None
        Of the first and the last snapshot.
    events : dict
        Number of events by kind.
    changed_share, variation_bits : RunningMean
        How the layout changed from map to map.
    frontier_m : float
        Open frontier of the last snapshot's rooms.
    stage_seconds, stage_seconds_max : dict
        Time per stage, summed and of the slowest snapshot.
    """

    snapshots: int = 0
    invalid: int = 0
    unchanged: int = 0
    rooms_last: int = 0
    tracks: int = 0
    coverage_first: float = 0.0
    coverage_last: float = 0.0
    first_log_time_ns: int | None = None
    last_log_time_ns: int | None = None
    events: Counter[str] = field(default_factory=Counter)
    changed_share: RunningMean = field(default_factory=RunningMean)
    variation_bits: RunningMean = field(default_factory=RunningMean)
    frontier_m: float = 0.0
    stage_seconds: dict[str, float] = field(default_factory=dict)
    stage_seconds_max: dict[str, float] = field(default_factory=dict)

    def add(self, step: TrackedSnapshot) -> None:
        """Take one snapshot."""
        if self.first_log_time_ns is None:
            self.first_log_time_ns = step.snapshot.log_time_ns
            self.coverage_first = step.coverage
        self.last_log_time_ns = step.snapshot.log_time_ns
        self.coverage_last = step.coverage
        self.snapshots += 1
        self.rooms_last = len(step.track_ids)
        self.tracks = max(self.tracks, *step.track_ids, 0)
        self.events.update(event.kind for event in step.events)
        if step.change is not None:
            self.changed_share.add(step.change.changed_share)
            self.variation_bits.add(step.change.variation_bits)
        if step.quality is not None:
            self.frontier_m = float(step.quality.frontier_m.sum())
        for stage, seconds in step.analysis.seconds.items():
            self.stage_seconds[stage] = self.stage_seconds.get(stage, 0.0) + seconds
            self.stage_seconds_max[stage] = max(self.stage_seconds_max.get(stage, 0.0), seconds)


def write_summary(
    path: Path,
    info: RunInfo,
    totals: RunTotals,
    histories: TrackHistories,
    convergence: Convergence | None,
    *,
    selection: dict[str, Any],
    messages: dict[str, int],
    files: list[str],
    warnings: dict[str, Any],
    copied: dict[str, Any] | None,
    seconds: float,
    workers: int,
) -> None:
    """Write the summary of a run that is over.

    Parameters
    ----------
    path : path
        Where to.
    info : RunInfo
        Log, method, resolved parameters, versions, provenance.
    totals : RunTotals
        What came out.
    histories, convergence : TrackHistories, Convergence
        What is known of every room, and since when it was right.
    selection, messages : dict
        Which maps were asked for, and what became of the log's messages.
    files : list of str
        Names of the other results, beside this one.
    warnings : dict
        What was odd about the log: how often, by kind, and the first ones.
    copied : dict, optional
        Number and hash of the messages of each channel in the log and in the annotated one.
    seconds : float
        Wall-clock time of the run. Times stand under ``seconds``; the rest is the same each time.
    workers : int
        Processes used.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    summary = {
        "log": info.origin or str(info.log_path),
        "log_location": info.place,
        "topic": info.topic,
        "method": info.method,
        "input": info.provenance,
        "versions": info.versions,
        "selection": selection,
        "parameters": info.parameters.resolved(),
        "messages": messages,
        "warnings": warnings,
        "results": {
            "snapshots": totals.snapshots,
            "invalid_maps": totals.invalid,
            "unchanged_maps": totals.unchanged,
            "first_log_time_ns": totals.first_log_time_ns,
            "last_log_time_ns": totals.last_log_time_ns,
            "coverage_first": totals.coverage_first,
            "coverage_last": totals.coverage_last,
            "rooms_last": totals.rooms_last,
            "tracks": totals.tracks,
            "events": dict(sorted(totals.events.items())),
        },
        "layout": _layout(totals, histories, convergence),
        "files": files,
        **({} if copied is None else {"annotated_log": copied}),
        "seconds": {
            "run": seconds,
            "workers": workers,
            "stages": totals.stage_seconds,
            "stages_max": totals.stage_seconds_max,
        },
    }
    write_json(path, summary)


def _layout(totals: RunTotals, histories: TrackHistories, convergence: Convergence | None) -> dict[str, Any]:
    """Tell how the layout came to be: since when it was final, how much it changed, how sure it is."""
    rooms = [histories.tracks[track] for track in histories.in_last_map]
    facts: dict[str, Any] = {
        "final_since": None,
        "changed_share_mean": totals.changed_share.mean,
        "changed_share_max": totals.changed_share.maximum,
        "variation_bits_mean": totals.variation_bits.mean,
        "variation_bits_max": totals.variation_bits.maximum,
        "wall_support_median": _median(room.wall_support for room in rooms),
        "frontier_m": totals.frontier_m,
    }
    if convergence is not None:
        settled, right = convergence.area_settled, convergence.shape_right
        facts |= {
            "final_since": convergence.layout_final and dataclasses.asdict(convergence.layout_final),
            "area_settled_coverage_median": _median(
                settled[track].coverage for track in histories.in_last_map
            ),
            "shape_right_coverage_median": _median(
                right[track].coverage for track in histories.in_last_map if track in right
            ),
            "shape_right_seen_share_median": _median(
                convergence.shape_right_seen.get(track) for track in histories.in_last_map
            ),
        }
    return facts


def _median(values: Iterable[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return median(known) if known else None


def write_json(path: Path, value: Any) -> None:
    """Write JSON beside its final name and rename it.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    with replacing(path) as part:
        part.write_text(json.dumps(value, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
