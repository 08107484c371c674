"""The report of one run: read, drawn and put into one HTML page."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rose2_logs import __version__
from rose2_logs.drawing.map_painter import Bounds
from rose2_logs.drawing.plan import FIGURE, PANEL, draw_plan
from rose2_logs.drawing.svg import as_svg
from rose2_logs.model.borders import UNSURE_BORDER_BELOW
from rose2_logs.model.room_plan import RoomPlan
from rose2_logs.outputs.report import PANELS, facts, tables
from rose2_logs.outputs.report.charts import run_charts, run_marks
from rose2_logs.outputs.report.seen import seen_rooms
from rose2_logs.outputs.report.words import duration
from rose2_logs.runs.run import Run
from rose2_logs.system.files import refuse_existing, replacing
from rose2_logs.system.text import percent

REPORT_NAME = "report.html"
TEMPLATES = Path(__file__).parent / "templates"


@dataclass(frozen=True)
class Panel:
    """A small picture of one map's layout: SVG, and two lines below it."""

    svg: str
    caption: str
    more: str


def write_report(
    folder: Path,
    out: Path | None = None,
    *,
    panels: int = PANELS,
    part: int | None = None,
    overwrite: bool = False,
    names: Path | None = None,
) -> Path:
    """Write the report of a run.

    Parameters
    ----------
    folder : path
        What `analyze_log` has written.
    out : path, optional
        The page, or a folder for it; by default ``report.html`` in the folder of results, or
        ``report_part_1.html`` of a part that is named.
    panels : int
        Small pictures of the layout along the run.
    part : int, optional
        The part to report on, of a run in which maps were begun anew; by default the last.
    overwrite : bool
        Whether an earlier page may be replaced.
    names : path, optional
        Other names for rooms, see `Run.rename`.

    Returns
    -------
    path
        The page.

    Raises
    ------
    LogError
        If the results cannot be read.
    ParameterError
        If there is no such part.
    OutputError
        If there is a page already that may not be replaced, or it cannot be written.
    """
    name = REPORT_NAME if part is None else f"report_part_{part}.html"
    out = folder / name if out is None else out / name if out.is_dir() else out
    refuse_existing([out], overwrite=overwrite)
    results = Run(folder, part=part)
    if part is None and results.parts:
        results = Run(folder, part=results.parts[-1])
    if names is not None:
        results.rename(names)
    text = render(
        "report.html.j2", **_content(results, panels, is_beside=out.parent.resolve() == folder.resolve())
    )
    write_page(out, text)
    return out


def write_page(path: Path, text: str) -> None:
    """Write a page.

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    with replacing(path) as part:
        part.write_text(text, encoding="utf-8")


def render(template: str, **content: Any) -> str:
    """Fill a template; everything but what was drawn by us is escaped."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(template).render(version=__version__, **content)


def drawn(svg: str) -> str:
    """Put a picture into the page unchanged: SVG in which all names are already escaped."""
    from markupsafe import Markup

    return Markup(svg)  # noqa: S704


def _content(results: Run, panels: int, *, is_beside: bool) -> dict[str, Any]:
    plan = results.plan(results.choose())
    drawn_panels = [Panel(drawn(svg), *caption) for svg, *caption in _panels(results, plan, panels)]
    is_run = len(results.columns["snapshot"]) > 1
    parameters = tables.parameter_table(results)
    seen = seen_rooms(results)
    return {
        "name": results.name,
        "subtitle": facts.subtitle(results),
        "tiles": facts.tiles(results, plan),
        "notes": facts.notes(results, plan),
        "meanings": facts.meanings(results),
        "plan": drawn(as_svg(draw_plan(plan, FIGURE), is_inline=True)),
        "panels": drawn_panels,
        "maps": len(results.columns["snapshot"]),
        "charts": [
            (chart, drawn(chart.over_coverage), drawn(chart.over_time))
            for chart in (run_charts(results) if is_run else ())
        ],
        "seen": seen,
        "seen_lanes": None if seen is None else drawn(seen.lanes),
        "marks": {kind for _, _, kind in run_marks(results)},
        "rooms": tables.room_table(results, plan),
        "doorways": tables.doorway_table(results, plan),
        "unsure_borders": tables.unsure_border_table(results, plan),
        "sure_from": percent(UNSURE_BORDER_BELOW),
        "events": tables.event_table(results),
        "parameters": parameters,
        "changed": tables.changed_parameters(parameters),
        "software": tables.software_table(results),
        "files": tables.files_of(results),
        "is_beside": is_beside,
        "recording": next((name for name in results.summary["files"] if str(name).endswith(".rrd")), None),
    }


def _panels(results: Run, last: RoomPlan, most: int) -> Iterator[tuple[str, str, str]]:
    """Yield the small pictures along the run, each with its two lines; one map at a time is held.

    All show the same part of the world: the last map, and the shapes of rooms that went beyond.
    """
    places = along_coverage(results.columns["coverage"].astype(float), most)
    numbers = [int(results.columns["snapshot"][place]) for place in places]
    bounds = last.bounds_m
    for number in numbers:
        shapes = results.plan(number, with_map=False)
        bounds = _around(bounds, shapes.bounds_m) if shapes.rooms else bounds
    for place, number in zip(places, numbers, strict=True):
        plan = results.plan(number)
        yield as_svg(draw_plan(plan, PANEL, bounds), is_inline=True), *_caption(results, plan, place)


def along_coverage(coverage: np.ndarray[Any, Any], most: int) -> list[int]:
    """Choose maps evenly along coverage: their places, ascending, the first and the last among them.

    Parameters
    ----------
    coverage : (N,) float
        Of each map.
    most : int
        How many; where few maps bring coverage, the widest gaps between the chosen are filled.
    """
    if len(coverage) <= most:
        return list(range(len(coverage)))
    if most <= 1:
        return [len(coverage) - 1]
    reached = np.maximum.accumulate(coverage)
    # The last target is the last map, and not one before it that covers as much.
    targets = np.linspace(reached[0], reached[-1], most)[1:-1]
    places = np.minimum(np.searchsorted(reached, targets - 1e-12), len(coverage) - 1)
    chosen = {0, len(coverage) - 1, *places.tolist()}
    while len(chosen) < most:
        ordered = sorted(chosen)
        gaps = np.diff(ordered)
        widest = int(np.argmax(gaps))
        chosen.add(ordered[widest] + int(gaps[widest]) // 2)
    return sorted(chosen)


def _caption(results: Run, plan: RoomPlan, place: int) -> tuple[str, str]:
    values = results.columns
    final = values["final_share"][place]
    right = "" if np.isnan(float(final)) else f", {percent(float(final))} as in the end"
    return (
        f"{percent(float(values['coverage'][place]))} coverage",
        f"map {values['snapshot'][place]}, {duration(values['time_s'][place])}, "
        f"{len(plan.rooms)} rooms{right}",
    )


def _around(one: Bounds, other: Bounds) -> Bounds:
    return min(one[0], other[0]), min(one[1], other[1]), max(one[2], other[2]), max(one[3], other[3])
