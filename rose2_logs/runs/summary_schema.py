"""What a summary holds: its keys and the types of their values, checked once when a folder is opened."""

from __future__ import annotations

import re
from typing import Annotated, Any, NotRequired, TypedDict

from msgspec import Meta, ValidationError, convert

LogTime = Annotated[int, Meta(ge=-(2**63), le=2**63 - 1)]
"""Nanoseconds since the epoch."""


class InputFile(TypedDict):
    """A file of the log."""

    name: str
    size_bytes: int
    sha256: str


class Input(TypedDict):
    """The log's files."""

    format: str
    size_bytes: int
    sha256: str
    files: list[InputFile]


class Messages(TypedDict):
    """How many map messages were used or left out."""

    messages: int
    repeats: int
    skipped: int
    updates_applied: int
    damaged: int
    invalid: int


class WarningsOfKind(TypedDict):
    """Warnings of one kind."""

    count: int
    first: list[dict[str, Any]]


class Warnings(TypedDict):
    """What was odd about the log."""

    count: int
    kinds: dict[str, WarningsOfKind]


class Results(TypedDict):
    """Figures of the whole run."""

    snapshots: int
    invalid_maps: int
    unchanged_maps: int
    first_log_time_ns: LogTime | None
    last_log_time_ns: LogTime | None
    coverage_first: float
    coverage_last: float
    rooms_last: int
    outside_m2_last: float
    tracks: int
    brief_tracks: int
    events: dict[str, int]


class Since(TypedDict):
    """From which map on something was as in the last one."""

    snapshot: int
    time_s: float
    coverage: float


class Layout(TypedDict):
    """How the layout developed; null where it is not known."""

    final_since: Since | None
    known_final_since: Since | None
    changed_share_mean: float | None
    changed_share_max: float | None
    variation_bits_mean: float | None
    variation_bits_max: float | None
    wall_support_median: float | None
    frontier_m: float
    area_settled_coverage_median: float | None
    shape_right_coverage_median: float | None
    shape_right_seen_share_median: float | None


class Seconds(TypedDict):
    """Times of the analysis."""

    run: float
    workers: int
    stages: dict[str, float]
    stages_max: dict[str, float]


class SummaryOfPart(TypedDict):
    """Figures of a part of a log in which maps were begun anew."""

    part: int
    results: dict[str, Any]
    layout: Layout


class NamesGiven(TypedDict):
    """The file that gave rooms names."""

    file: str
    sha256: str


class Summary(TypedDict):
    """The whole file; sinks may add further keys."""

    results_format: int
    log: str
    topic: str
    method: str
    input: Input
    versions: dict[str, str]
    selection: dict[str, Any]
    parameters: dict[str, Any]
    messages: Messages
    decided: dict[str, Any]
    names: NotRequired[NamesGiven]
    warnings: Warnings
    results: Results
    layout: Layout
    parts: NotRequired[list[SummaryOfPart]]
    files: list[str]
    seconds: Seconds


_AT = re.compile(r" - at `\$\.?(.*?)`$")
_MISSING = re.compile(r"missing required field `(.*?)`")


def what_it_lacks(summary: Any) -> str | None:
    """Say in words which key of a summary is missing or has a value of another type; None if none is."""
    try:
        convert(summary, Summary)
    except ValidationError as error:
        told = str(error)
        at = found[1] if (found := _AT.search(told)) else ""
        if missing := _MISSING.search(told):
            return f"its {'.'.join(part for part in (at, missing[1]) if part)} is missing"
        return f"its {at or 'content'} is damaged: {_AT.sub('', told).lower()}"
    return None
