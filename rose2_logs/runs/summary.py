"""``summary.json``: input, options and results of a run, for people and scripts."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rose2_logs.errors import OutputError
from rose2_logs.runs.history import RunSummary, median_of
from rose2_logs.runs.sink import RunInfo
from rose2_logs.system.files import reason_of, replacing

SUMMARY = "summary.json"
"""Its name in the folder of a run."""
RESULTS_FORMAT = 3
"""Number of the layout of a run's folder; 1, without the number, was that of version 0.1."""


def write_summary(
    path: Path,
    info: RunInfo,
    summary: RunSummary,
    *,
    selection: Mapping[str, Any],
    messages: Mapping[str, int],
    decided: Mapping[str, Any],
    names: Mapping[str, Any] | None = None,
    files: list[str],
    warnings: Mapping[str, Any],
    facts: Mapping[str, Any],
    seconds: float,
    workers: int,
) -> None:
    """Write the summary of a run that is over.

    Parameters
    ----------
    path : path
        The file to write.
    info : RunInfo
        Log, method, resolved parameters, versions, provenance.
    summary : RunSummary
        Results of the run.
    selection, messages : mapping
        Which maps were requested, and how many messages were used or left out.
    decided : mapping
        What was decided about how the log is read.
    names : mapping, optional
        Which file gave the rooms names.
    files : list of str
        Names of the other files of the results.
    warnings : mapping
        What was odd about the log: how often, by kind, and the first ones.
    facts : mapping
        What the sinks add.
    seconds : float
        Wall-clock time of the run. Times are under ``seconds``; the rest is the same each time.
    workers : int
        Processes used.

    Raises
    ------
    OutputError
        If the file cannot be written, or a fact has the name of another entry or is no JSON value.
    """
    totals = summary.totals
    content = {
        "results_format": RESULTS_FORMAT,
        "log": info.origin or str(info.log_path),
        "topic": info.topic,
        "method": info.method,
        "input": info.provenance,
        "versions": info.versions,
        "selection": dict(selection),
        "parameters": info.parameters.resolved(),
        "messages": dict(messages),
        "decided": dict(decided),
        **({} if names is None else {"names": dict(names)}),
        "warnings": dict(warnings),
        "results": {
            "snapshots": totals.snapshots,
            "invalid_maps": totals.invalid,
            "unchanged_maps": totals.unchanged,
            **_results(summary),
        },
        "layout": _layout(summary),
        **({"parts": _parts(summary)} if summary.parts else {}),
        "files": files,
        "seconds": {
            "run": seconds,
            "workers": workers,
            "stages": totals.stage_seconds,
            "stages_max": totals.stage_seconds_max,
        },
    }
    if taken := sorted(facts.keys() & content.keys()):
        raise OutputError(f"{path}: a sink has a fact named {taken[0]!r}, which the summary itself has")
    write_json(path, content | dict(facts))


def _results(summary: RunSummary) -> dict[str, Any]:
    """Return what the run, or a part of it, came to."""
    totals = summary.totals
    return {
        "first_log_time_ns": totals.first_log_time_ns,
        "last_log_time_ns": totals.last_log_time_ns,
        "coverage_first": totals.coverage_first,
        "coverage_last": totals.coverage_last,
        "rooms_last": totals.rooms_last,
        "outside_m2_last": totals.outside_m2_last,
        "tracks": totals.tracks,
        "brief_tracks": len(summary.convergence.brief),
        "events": dict(sorted(totals.events.items())),
    }


def _parts(summary: RunSummary) -> list[dict[str, Any]]:
    """Describe each part of a run in the form of the whole."""
    return [
        {
            "part": number,
            "results": {"snapshots": part.totals.snapshots, **_results(part)},
            "layout": _layout(part),
        }
        for number, part in summary.parts.items()
    ]


def _layout(summary: RunSummary) -> dict[str, Any]:
    """Describe how the layout developed: since when it was final, how much it changed, how sure it is."""
    totals, histories, convergence = summary.totals, summary.histories, summary.convergence
    final, known = convergence.layout_final, convergence.known_final
    rooms = [histories.tracks[track] for track in histories.in_last_map]
    seen_shares = (convergence.shape_right_seen.get(track) for track in histories.in_last_map)
    return {
        "final_since": final and dataclasses.asdict(final),
        "known_final_since": known and dataclasses.asdict(known),
        "changed_share_mean": totals.changed_share.mean,
        "changed_share_max": totals.changed_share.maximum,
        "variation_bits_mean": totals.variation_bits.mean,
        "variation_bits_max": totals.variation_bits.maximum,
        "wall_support_median": median_of(room.wall_support for room in rooms),
        "frontier_m": totals.frontier_m,
        "area_settled_coverage_median": summary.median_coverage(convergence.area_settled),
        "shape_right_coverage_median": summary.median_coverage(convergence.shape_right),
        "shape_right_seen_share_median": median_of(seen_shares),
    }


def write_json(path: Path, value: Any) -> None:
    """Write JSON under a hidden name and rename it.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    try:
        text = json.dumps(value, indent=2, ensure_ascii=False)
    except (TypeError, ValueError) as error:
        raise OutputError(f"{path}: cannot be written: {reason_of(error)}") from error
    with replacing(path) as part:
        part.write_text(f"{text}\n", encoding="utf-8")
