"""Reports of all logs below a folder, and a page that lists them."""

from __future__ import annotations

import csv
import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

from rose2_logs.comparison.final_layout import FinalLayout
from rose2_logs.drawing.comparison_picture import draw_comparison
from rose2_logs.drawing.pixels import as_pixels
from rose2_logs.drawing.plan import PANEL, draw_plan
from rose2_logs.drawing.svg import png_uri
from rose2_logs.errors import LogError, ParameterError
from rose2_logs.outputs.report import PANELS
from rose2_logs.outputs.report.buildings import same_buildings
from rose2_logs.outputs.report.comparison import changed_rooms, comparison_page
from rose2_logs.outputs.report.page import REPORT_NAME, render, write_page, write_report
from rose2_logs.outputs.report.words import (
    MISSING,
    Cell,
    Column,
    Table,
    count,
    date_of,
    duration,
    number,
    share,
)
from rose2_logs.runs.last_layout import read_final_layout
from rose2_logs.runs.run import Run, is_last
from rose2_logs.runs.stored_run import find_results
from rose2_logs.system.files import refuse_existing

PICTURES_MOST = 100
"""Logs whose last layout is pictured on the page that lists them: about a megabyte."""
PICTURE_PX = 320
PICTURE = dataclasses.replace(PANEL, font=0.0)
COMPARISON_ENDING = ".comparison.html"
"""Of the page on what differs between a run and another of the same building; beside the run's own page."""
BUILDING_COLUMNS = (
    Column("log", is_number=False),
    Column("rooms", "in the last map"),
    Column("floor in both", "intersection over union of all rooms"),
    Column("rooms alike", "mean overlap, by area"),
    Column("walls agree", "where both have explored"),
    Column("rooms by how they changed", is_number=False),
)
BATCH_FOLDER = "logs/"
"""Where a batch keeps the results of its logs; the names on the page leave it out."""
BATCH_SUMMARY = "summary.csv"
"""Where a batch writes how each log ended."""


@dataclass(frozen=True)
class ReportsWritten:
    """The pages, the list of several last, and why results could not be read."""

    pages: tuple[Path, ...]
    failed: tuple[LogError, ...]


@dataclass(frozen=True)
class _Listed:
    """A log on the page that lists them: its page, the address from there, name, picture, figures."""

    page: Path
    link: str
    name: str
    picture: str
    row: tuple[Cell, ...]
    layout: FinalLayout


@dataclass(frozen=True)
class _Building:
    """Runs of one building on the page that lists them: what they are compared with, their table."""

    reference: str
    table: Table
    links: tuple[str, ...]


def write_reports(
    folder: Path,
    out: Path | None = None,
    *,
    panels: int = PANELS,
    part: int | None = None,
    overwrite: bool = False,
    names: Path | None = None,
) -> ReportsWritten:
    """Write the report of a log, or of all logs below a folder with a page that lists them.

    Parameters
    ----------
    folder : path
        What `analyze_log` or a batch has written.
    out : path, optional
        The page of one log; of several the folder for their pages. By default each goes next to its results.
    panels, overwrite, names
        As for `write_report`; names are for the rooms of one log.
    part : int, optional
        As for `write_report`; only of one log.

    Returns
    -------
    ReportsWritten

    Raises
    ------
    LogError
        If there are no results, or those of the only log cannot be read.
    ParameterError
        If there is no such part, or a part of several logs is wanted.
    OutputError
        If there is a page already that may not be replaced, or one cannot be written.
    """
    found = find_results(folder)
    if found == [folder]:
        page = write_report(folder, out, panels=panels, part=part, overwrite=overwrite, names=names)
        return ReportsWritten((page,), ())
    if part is not None:
        raise ParameterError(f"{folder}: holds the results of several logs; part={part} is of one of them")
    if names is not None:
        raise ParameterError(f"{folder}: holds the results of {len(found)} logs; names are for those of one")
    base = folder if out is None else out
    below = [each.relative_to(folder).as_posix() for each in found]
    pages = [base / (f"{name}/{REPORT_NAME}" if out is None else f"{name}.html") for name in below]
    listing = base / REPORT_NAME
    refuse_existing([listing, *pages], overwrite=overwrite)
    written: list[_Listed] = []
    failed: list[LogError] = []
    for results_folder, name, page in zip(found, below, pages, strict=True):
        try:
            write_report(results_folder, page, panels=panels, overwrite=overwrite)
            results, shown = Run(results_folder), name.removeprefix(BATCH_FOLDER)
            picture = _picture(results) if len(written) < PICTURES_MOST else ""
            written.append(
                _Listed(
                    page,
                    quote(page.relative_to(base).as_posix()),
                    shown,
                    picture,
                    _row(results, shown),
                    read_final_layout(results, shown),
                )
            )
        except LogError as error:
            failed.append(error)
    if written:
        buildings, not_compared = _buildings(written)
        title = f"Rooms of {len(written)} logs"
        table = _table([each.row for each in written])
        failures = _failures(folder)
        page_text = render(
            "overview.html.j2",
            title=title,
            table=table,
            logs=written,
            failures=failures,
            buildings=buildings,
            not_compared=not_compared,
        )
        write_page(listing, page_text)
        return ReportsWritten((*(each.page for each in written), listing), tuple(failed))
    return ReportsWritten((), tuple(failed))


def _buildings(written: list[_Listed]) -> tuple[list[_Building], int]:
    """Compare the runs of each building with the one that shows most of it, on pages of their own.

    Returns
    -------
    buildings : list of _Building
    not_compared : int
        Runs that were not compared with all others.
    """
    found, left_out = same_buildings([each.layout for each in written])
    shown = []
    for building in found:
        rows, links = [], []
        for place, comparison in sorted(building.others.items()):
            each = written[place]
            page = each.page.with_name(f"{each.page.stem}{COMPARISON_ENDING}")
            write_page(page, comparison_page(comparison, draw_comparison(comparison)))
            links.append(each.link.removesuffix(".html") + COMPARISON_ENDING)
            rows.append(
                (
                    Cell(each.name),
                    count(len(comparison.b.tracks)),
                    share(comparison.floor_iou),
                    share(comparison.rooms_iou),
                    share(comparison.placement.agreement),
                    Cell(changed_rooms(comparison)),
                )
            )
        reference = written[building.reference].name
        shown.append(
            _Building(
                reference, Table(f"Compared with {reference}", BUILDING_COLUMNS, tuple(rows)), tuple(links)
            )
        )
    return shown, len(left_out)


def _failures(folder: Path) -> list[tuple[str, str]]:
    """Names of the logs that a batch could not analyze, and why."""
    try:
        with (folder / BATCH_SUMMARY).open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        return [(row["log"], row["reason"]) for row in rows if row["status"] == "failed"]
    except (OSError, ValueError, KeyError, csv.Error):
        # The page tells of results; without a batch there are no others.
        return []


def _picture(results: Run) -> str:
    """Picture of the last layout as a data URI."""
    plan = results.plan(results.choose())
    return png_uri(as_pixels(draw_plan(plan, PICTURE), PICTURE_PX), few_colors=True)


def _table(rows: list[tuple[Cell, ...]]) -> Table:
    columns = (
        Column("log", is_number=False),
        Column("recorded", is_number=False),
        Column("duration"),
        Column("maps"),
        Column("first coverage", "coverage of the first map"),
        Column("rooms", "in the last map"),
        Column("tracks", "rooms over the run"),
        Column(
            "final from", "coverage from which on the layout was as in the end; none if only the last map was"
        ),
        Column(
            "known part final from",
            "coverage from which on what was known of it was as in the end; none if only the last map was",
        ),
        Column("splits"),
        Column("merges"),
        Column("shifts", "of the whole map"),
        Column("wall support", "share of the outlines supported by walls, median of the last map's rooms"),
        Column("frontier, m", "open frontier of the last map's rooms"),
    )
    return Table("Logs", columns, tuple(rows))


def _since(final: dict[str, Any] | None, results: Run) -> Cell:
    """Coverage from which on a layout was final, unless only the last map was."""
    return share(None if final is None or is_last(final, results.choose()) else final["coverage"])


def _row(results: Run, name: str) -> tuple[Cell, ...]:
    found, layout = results.summary["results"], results.summary.get("layout", {})
    events = found.get("events", {})
    first_ns, last_ns = found.get("first_log_time_ns"), found.get("last_log_time_ns")
    span = None if first_ns is None or last_ns is None else (last_ns - first_ns) / 1e9
    return (
        Cell(name),
        Cell(date_of(first_ns) or MISSING),
        Cell(MISSING) if span is None else Cell(duration(span), span),
        count(found["snapshots"]),
        share(found["coverage_first"]),
        count(found["rooms_last"]),
        count(found["tracks"]),
        _since(layout.get("final_since"), results),
        _since(layout.get("known_final_since"), results),
        count(events.get("split", 0)),
        count(events.get("merged", 0)),
        count(events.get("shifted", 0)),
        share(layout.get("wall_support_median")),
        number(layout.get("frontier_m")),
    )
