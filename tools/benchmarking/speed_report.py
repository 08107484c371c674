"""The report of how fast everything is: Markdown, a picture, JSON."""

from __future__ import annotations

from collections.abc import Sequence
from math import log
from pathlib import Path

import numpy as np

from benchmarking.against import against_lines
from benchmarking.map_times import MapTimes
from benchmarking.markdown import table
from benchmarking.scaling import LogTimes, TileTimes
from benchmarking.speed import GROWING_SIDE, Speed
from rose2_logs.drawing.chart import Curve, line_chart
from rose2_logs.drawing.drawing import Drawing
from rose2_logs.drawing.sheet import stacked
from rose2_logs.runs.summary import write_json
from rose2_logs.segmentation.pipeline import METHODS

EXPLAINED = """\
Times of maps are seconds of processor time of one core, everything run once before; `whole` is reading the
map from its file and its analysis. `floor`: reading the same map, one real Fourier transform and one Hough
transform of it, which no method of this kind can do without. Memory is above that of the map, the result
included, for each cell of the explored box."""


def write_speed_report(speed: Speed, folder: Path) -> Path:
    """Write ``speed.md``, ``speed.png`` and ``speed.json``; returns the first.

    Raises
    ------
    OutputError
        If a file cannot be written.
    """
    write_json(folder / "speed.json", speed.as_json())
    lines = ["# Speed", "", *_facts(speed), EXPLAINED, ""]
    if pictures := _charts(speed):
        stacked(pictures).save(folder / "speed.png", width_px=None)
        lines += ["![times and memory](speed.png)", ""]
    lines += [
        *(against_lines(speed.against) if speed.against else []),
        *_groups(speed),
        *_tiles(speed),
        *_logs(speed),
        *_outputs(speed),
        *_around(speed),
        *_maps(speed),
    ]
    path = folder / "speed.md"
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


def _facts(speed: Speed) -> list[str]:
    machine = ", ".join(f"{name}: {value}" for name, value in speed.machine.items())
    versions = ", ".join(f"{name} {version}" for name, version in speed.versions.items())
    return [f"{machine}. {versions}. Medians of {speed.repeats} runs.", ""]


def _of(maps: Sequence[MapTimes], group: str) -> list[MapTimes]:
    return [times for times in maps if group in (times.group, "all")]


def _groups(speed: Speed) -> list[str]:
    if not speed.maps:
        return []
    groups = [*dict.fromkeys(times.group for times in speed.maps), "all"]
    stages = list(speed.maps[0].stages_s)
    summary, by_stage = [], []
    for group in groups:
        members = _of(speed.maps, group)
        whole = [times.whole_s for times in members]
        peaks = [times.peak_bytes / times.explored_cells for times in members if times.peak_bytes is not None]
        arrays = [times.arrays_bytes / times.explored_cells for times in members]
        others = [np.median([times.methods_s[name] for times in members]) for name in METHODS[1:]]
        summary.append(
            [
                f"{group} ({len(members)})",
                f"{np.median(whole):.3f}",
                f"{max(whole):.3f}",
                f"{np.median([times.over_floor for times in members]):.1f}",
                *(f"{value:.3f}" for value in others),
                f"{np.median(arrays):.0f} / {max(arrays):.0f}",
                f"{np.median(peaks):.0f} / {max(peaks):.0f}" if peaks else "",
            ]
        )
        by_stage.append(
            [
                f"{group} ({len(members)})",
                f"{1000 * np.median([times.decode_s for times in members]):.1f}",
                *(
                    f"{1000 * np.median([times.stages_s.get(stage, 0.0) for times in members]):.1f}"
                    for stage in stages
                ),
                f"{1000 * np.median([times.floor_s for times in members]):.1f}",
            ]
        )
    head = [
        "group (maps)",
        "whole, median s",
        "slowest s",
        "over floor",
        *METHODS[1:],
        "bytes a cell, median / most",
        "of the process",
    ]
    return [
        "## Each map",
        "",
        "The analysis by the other methods in seconds, medians. Memory above the map, for each explored "
        "cell: the most that arrays and objects take at once, and how far the process grows, with what "
        "libraries and allocators hold, some megabytes whatever the map's size.",
        "",
        *table(head, summary),
        "### By stage, median milliseconds",
        "",
        *table(["group (maps)", "read", *stages, "transforms of the floor"], by_stage),
    ]


def _tiles(speed: Speed) -> list[str]:
    if not speed.tiles:
        return []
    first = speed.tiles[0]

    def growth(row: TileTimes) -> float:
        """Of the time from the first row, over that of n log n."""
        cells, at_first = float(row.explored_cells), float(first.explored_cells)
        return row.analysis_s / first.analysis_s / (cells * log(cells) / (at_first * log(at_first)))

    rows = [
        [
            str(row.copies),
            f"{row.explored_cells / 1e6:.2f}",
            f"{row.rooms}",
            f"{row.analysis_s:.2f}",
            f"{1e6 * row.analysis_s / row.explored_cells:.3f}",
            f"{growth(row):.2f}",
            "" if row.peak_bytes is None else f"{row.peak_bytes / row.explored_cells:.0f}",
            f"{row.resolution_m:.3g}",
        ]
        for row in speed.tiles
    ]
    head = [
        "copies",
        "million cells",
        "rooms",
        "s",
        "microseconds a cell",
        "over n log n",
        "bytes a cell",
        "analyzed at m",
    ]
    return [
        "## The same building laid out again and again",
        "",
        "`over n log n`: growth of the time over that of n log n in the explored cells, from one copy.",
        "",
        *table(head, rows),
    ]


def _logs(speed: Speed) -> list[str]:
    if not speed.logs:
        return []
    rows = []
    for row in speed.logs:
        alone = next(other for other in speed.logs if other.snapshots == row.snapshots and other.workers == 1)
        gain = "" if row is alone else f"{alone.wall_s / row.wall_s:.2f} ({2 * alone.cpu_s / row.cpu_s:.2f})"
        rows.append(
            [
                str(row.snapshots),
                str(row.workers),
                f"{row.wall_s:.1f}",
                f"{row.cpu_s:.1f}",
                f"{row.snapshots / row.wall_s:.2f}",
                gain,
                "" if row.peak_bytes is None else f"{row.peak_bytes / 1e6:.0f}",
                f"{row.log_bytes / 1e6:.1f}",
                f"{row.recording_bytes / row.snapshots / 1e3:.0f}",
            ]
        )
    head = [
        "maps",
        "workers",
        "wall s",
        "processor s",
        "maps a second",
        "gain (bound)",
        "peak MB",
        "log MB",
        ".rrd kB a map",
    ]
    side_by_side = "" if speed.side_by_side is None else f"{speed.side_by_side:.2f}"
    return [
        f"## Logs of maps of {GROWING_SIDE} x {GROWING_SIDE} cells",
        "",
        "`rose2-logs analyze` with all outputs, from its start to its end; the map is uncovered from its"
        " middle. `gain`: wall-clock time with one worker over that with two; in brackets what it would be if"
        " two cores were busy all the time. Two commands of one worker side by side gain"
        f" {side_by_side} here. `peak`: sum of the peaks of all processes.",
        "",
        *table(head, rows),
    ]


def _outputs(speed: Speed) -> list[str]:
    if not speed.outputs:
        return []
    rows = []
    for costs in speed.outputs:
        per_map = [costs.analysis_s, costs.tracking_and_reading_s, *costs.sinks_s.values()]
        rows.append(
            [
                f"{costs.log} ({costs.maps})",
                *(f"{1000 * seconds / costs.maps:.1f}" for seconds in per_map),
                f"{100 * costs.share:.0f}%",
                *(f"{size / costs.maps / 1e3:.0f}" for size in costs.sizes.values()),
            ]
        )
    names = list(speed.outputs[0].sinks_s)
    sizes = [f"{name}, kB a map" for name in speed.outputs[0].sizes]
    head = ["log (maps)", "analysis", "reading, tracking", *names, "recording and log over analysis", *sizes]
    return ["## Outputs, milliseconds of one core a map", "", *table(head, rows)]


def _around(speed: Speed) -> list[str]:
    lines = []
    if speed.copy is not None:
        copy = speed.copy
        lines += [
            "## The annotated log",
            "",
            f"A log of {copy.size_bytes / 1e6:.0f} MB in compressed chunks, the results of two maps added:"
            f" {copy.size_bytes / 1e6 / copy.cpu_s:.0f} MB a second of processor time,"
            f" {copy.size_bytes / 1e6 / copy.wall_s:.0f} MB a second on this disk.",
            "",
        ]
    if speed.starts:
        rows = [[f"`{row.command}`", f"{row.wall_s:.2f}", f"{row.least_wall_s:.2f}"] for row in speed.starts]
        lines += [
            "## Starting up",
            "",
            *table(["command", "median s", "least s"], rows),
        ]
    if speed.look is not None:
        look = speed.look
        read = "an unknown number of" if look.read_bytes is None else f"{look.read_bytes / 1e6:.1f}"
        lines += [
            f"`info` on an indexed log of {look.size_bytes / 1e9:.1f} GB, {look.maps} maps, reads {read} MB"
            f" in {look.cpu_s:.2f} s of processor time, starting up apart.",
            "",
        ]
    return lines


def _maps(speed: Speed) -> list[str]:
    if not speed.maps:
        return []
    rows = [
        [
            f"{times.group}: {times.name}",
            f"{times.cells / 1e6:.2f}",
            f"{times.explored_cells / 1e6:.2f}",
            str(times.rooms),
            f"{times.whole_s:.3f}",
            *(f"{1000 * seconds:.0f}" for seconds in times.stages_s.values()),
            f"{times.over_floor:.1f}",
            f"{times.arrays_bytes / times.explored_cells:.0f}",
        ]
        for times in speed.maps
    ]
    stages = [f"{stage} ms" for stage in speed.maps[0].stages_s]
    head = ["map", "million cells", "explored", "rooms", "whole s", *stages, "over floor", "bytes a cell"]
    return ["## All maps", "", *table(head, rows)]


def _charts(speed: Speed) -> list[Drawing]:
    charts = []
    if speed.maps:
        order = np.arange(1.0, len(speed.maps) + 1)
        columns = {
            "rose2": [times.whole_s for times in speed.maps],
            **{
                name: [times.decode_s + times.methods_s[name] for times in speed.maps] for name in METHODS[1:]
            },
            "floor": [times.decode_s + times.floor_s for times in speed.maps],
        }
        curves = [Curve(name, order, np.sort(np.array(values))) for name, values in columns.items()]
        charts.append(
            line_chart(
                curves,
                title="seconds of a map on one core",
                x_label="maps, for each the fastest first",
                log_y=True,
            )
        )
    sizes = []
    if speed.maps:
        cells = np.array([float(times.explored_cells) for times in speed.maps])
        seconds = np.array([times.analysis_s for times in speed.maps])
        sizes.append(Curve("each map", cells, seconds, is_joined=False))
    if speed.tiles:
        cells = np.array([float(row.explored_cells) for row in speed.tiles])
        seconds = np.array([row.analysis_s for row in speed.tiles])
        sizes.append(Curve("one building, tiled", cells, seconds))
    if sizes:
        charts.append(
            line_chart(
                sizes, title="seconds of an analysis", x_label="explored cells", log_x=True, log_y=True
            )
        )
    known = [row for row in speed.logs if row.peak_bytes is not None]
    if known:
        charts.append(
            line_chart(
                _memory_curves(known),
                title="peak memory of a run, MB",
                x_label="maps of the log",
                log_x=True,
            )
        )
    return charts


def _memory_curves(logs: Sequence[LogTimes]) -> list[Curve]:
    return [
        Curve(
            f"{workers} worker" + "s" * (workers > 1),
            np.array([float(row.snapshots) for row in logs if row.workers == workers]),
            np.array([(row.peak_bytes or 0) / 1e6 for row in logs if row.workers == workers]),
        )
        for workers in sorted({row.workers for row in logs})
    ]
