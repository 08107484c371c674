"""``info``: what a log holds."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape

from rose2_logs.cli.flags import with_flags
from rose2_logs.cli.messages import printable
from rose2_logs.cli.printing import duration, megabytes, print_json, print_line, print_table, shown
from rose2_logs.config.parameters import Parameters

if TYPE_CHECKING:
    from rose2_logs.workflows.info import LogFacts, MapFacts

EXAMPLE = "Example: [bold]rose2-logs info run.mcap[/bold]"
EXAMPLES = {"info": EXAMPLE}


def info(
    log: Annotated[
        str,
        typer.Argument(
            metavar="LOG", help="MCAP, ROS 1 bag, ROS 2 bag, CARMEN log, saved map, or folder of saved maps."
        ),
    ],
    parameters: Parameters,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, for programs.")] = False,
) -> None:
    """Show what a log holds: topics, duration, map sizes, resolution, coverage."""
    from rose2_logs.workflows.info import describe_log

    facts = describe_log(log, parameters)
    if as_json:
        print_json(facts.as_json())
    else:
        print_log_facts(facts)


def print_log_facts(facts: LogFacts) -> None:
    """Print what a log holds."""
    from rich.table import Table

    info = facts.info
    print_line(f"[bold]{shown(info.path)}[/]")
    index = "" if info.indexed else ", no index: read from its beginning"
    index += "" if info.whole else ", damaged: what is whole of it"
    print_line(f"{info.format}, {megabytes(info.size_bytes)}, {duration(info.duration_s)}{index}")
    table = Table("topic", "type", "encoding", "messages", "map", box=None, pad_edge=False)
    for topic in info.topics:
        count = "?" if topic.message_count is None else str(topic.message_count)
        is_map = "yes" if topic.is_map else ""
        names = (escape(printable(text)) for text in (topic.name, topic.message_type, topic.encoding))
        table.add_row(*names, count, is_map)
    print_table(table)
    for topic_facts in facts.maps:
        if topic_facts.first is None or topic_facts.last is None:
            trouble = escape(printable(with_flags(topic_facts.trouble or "")))
            print_line(f"[bold]{escape(printable(topic_facts.topic))}[/]: {trouble}")
            continue
        frame = escape(printable(topic_facts.last.frame_id))
        print_line(f"[bold]{escape(printable(topic_facts.topic))}[/] in frame {frame}")
        print_line(f"  first map {_map_line(topic_facts.first)}")
        print_line(f"  last map  {_map_line(topic_facts.last)}")
        if topic_facts.coverage_first is not None:
            print_line(f"  coverage  {topic_facts.coverage_first:.1%} to 100.0%")
    if not facts.maps and facts.map_from:
        scans = escape(printable(facts.map_from[0]))
        print_line(f"no occupancy grids: analyze --map-from {scans} builds maps from its laser scans")
    elif not facts.maps and (untyped := [each.name for each in info.topics if not each.message_type]):
        print_line(
            f"no occupancy grids that say so: if those on {escape(printable(untyped[0]))} are maps, "
            "analyze --type nav_msgs/OccupancyGrid reads them"
        )
    elif not facts.maps:
        from rose2_logs.io.scan_topics import without_transforms

        scans = escape(printable(without_transforms(info)))
        print_line(f"no occupancy grids{scans and '; '}{scans}: analyze cannot use this log")


def _map_line(facts: MapFacts) -> str:
    height, width = facts.shape
    return (
        f"{width} x {height} cells of {facts.resolution_m:.4g} m "
        f"({width * facts.resolution_m:.1f} x {height * facts.resolution_m:.1f} m), "
        f"{facts.free_area_m2:.1f} m2 free"
    )
