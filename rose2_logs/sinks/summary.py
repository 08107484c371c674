"""``summary.json``: what a run was made of and what came out, for people and scripts."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rose2_logs.errors import OutputError
from rose2_logs.sinks.sink import RunInfo
from rose2_logs.tracking.frames import TrackedSnapshot


@dataclass
class RunTotals:
    """What is summed up over a run, snapshot by snapshot.

    Attributes
    ----------
    snapshots : int
        Maps that were analysed.
    invalid : int
        Maps that could not be analysed and were left out.
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
    stage_seconds, stage_seconds_max : dict
        Time per stage, summed and of the slowest snapshot.
    """

    snapshots: int = 0
    invalid: int = 0
    rooms_last: int = 0
    tracks: int = 0
    coverage_first: float = 0.0
    coverage_last: float = 0.0
    first_log_time_ns: int | None = None
    last_log_time_ns: int | None = None
    events: Counter[str] = field(default_factory=Counter)
    stage_seconds: dict[str, float] = field(default_factory=dict)
    stage_seconds_max: dict[str, float] = field(default_factory=dict)

    def add(self, frame: TrackedSnapshot) -> None:
        """Take one snapshot."""
        if self.first_log_time_ns is None:
            self.first_log_time_ns = frame.snapshot.log_time_ns
            self.coverage_first = frame.coverage
        self.last_log_time_ns = frame.snapshot.log_time_ns
        self.coverage_last = frame.coverage
        self.snapshots += 1
        self.rooms_last = len(frame.track_ids)
        self.tracks = max(self.tracks, *frame.track_ids, 0)
        self.events.update(event.kind for event in frame.events)
        for stage, seconds in frame.analysis.seconds.items():
            self.stage_seconds[stage] = self.stage_seconds.get(stage, 0.0) + seconds
            self.stage_seconds_max[stage] = max(self.stage_seconds_max.get(stage, 0.0), seconds)


def write_summary(
    path: Path,
    info: RunInfo,
    totals: RunTotals,
    *,
    selection: dict[str, Any],
    messages: dict[str, int],
    files: list[str],
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
    selection, messages : dict
        Which maps were asked for, and what became of the log's messages.
    files : list of str
        Names of the other results, beside this one.
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
        "topic": info.topic,
        "method": info.method,
        "input": info.provenance,
        "versions": info.versions,
        "selection": selection,
        "parameters": info.parameters.resolved(),
        "messages": messages,
        "results": {
            "snapshots": totals.snapshots,
            "invalid_maps": totals.invalid,
            "first_log_time_ns": totals.first_log_time_ns,
            "last_log_time_ns": totals.last_log_time_ns,
            "coverage_first": totals.coverage_first,
            "coverage_last": totals.coverage_last,
            "rooms_last": totals.rooms_last,
            "tracks": totals.tracks,
            "events": dict(sorted(totals.events.items())),
        },
        "files": files,
        "seconds": {
            "run": seconds,
            "workers": workers,
            "stages": totals.stage_seconds,
            "stages_max": totals.stage_seconds_max,
        },
    }
    write_json(path, summary)


def write_json(path: Path, value: Any) -> None:
    """Write JSON beside its final name and rename it.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    part = path.with_name(f".{path.name}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part.write_text(json.dumps(value, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
        part.replace(path)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise OutputError(f"{path}: cannot be written: {error}") from error
