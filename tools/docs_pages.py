"""Pages of the documentation that are written from the code: commands, parameters, tables.

MkDocs calls `on_files` when it builds the site, see ``mkdocs.yml``. To read a page without building it:

    python tools/docs_pages.py reference/parameters.md
"""

from __future__ import annotations

import dataclasses
import re
import sys
from collections.abc import Callable
from typing import Any

import pyarrow as pa
import typer

from rose2_logs.cli.main import app
from rose2_logs.config.parameters import Parameters, describe_parameters
from rose2_logs.runs import table_schemas

NAME = "rose2-logs"
TABLES = {
    "snapshots.parquet": (table_schemas.SNAPSHOTS, "One row a map."),
    "rooms.parquet": (table_schemas.ROOMS, "One row a room and map."),
    "tracks.parquet": (table_schemas.TRACKS, "One row a room over the run."),
    "events.parquet": (table_schemas.EVENTS, "One row an event."),
    "doorways.parquet": (table_schemas.DOORWAYS, "One row a doorway and map."),
    "back_projected.parquet (analyze --back-project)": (
        table_schemas.BACK_PROJECTED,
        "One row a room of the last map and map that shows some of it.",
    ),
    "room_changes.parquet": (
        table_schemas.ROOM_CHANGES,
        "Of `compare`: one row a group of rooms that belong together, or a room alone.",
    ),
    "wall_changes.parquet": (
        table_schemas.WALL_CHANGES,
        "Of `compare`: one row a stretch of wall that differs.",
    ),
}


def commands_page() -> str:
    """Every command with its arguments and options, as its help tells them."""
    group: Any = typer.main.get_command(app)
    lines = ["# Commands", "", _text(group.help), ""]
    lines += ["Exit codes: 0 done; 1 internal error; 2 a log, a file or an option cannot be used (one line"]
    lines += ["says which); 130 interrupted.", "", *_options_table(group.params)]
    for name, command in group.commands.items():
        lines += ["", f"## {name}", "", _text(command.help), ""]
        given = " ".join(_argument(param) for param in command.params if not _is_option(param))
        lines += ["```text", f"{NAME} {name} [OPTIONS] {given}", "```", ""]
        lines += _options_table(command.params)
        if command.epilog:
            lines += ["", _text(command.epilog)]
    return "\n".join(lines) + "\n"


def _is_option(param: Any) -> bool:
    return bool(param.opts[0].startswith("-"))


def _argument(param: Any) -> str:
    return str(param.metavar or param.name.upper())


def _options_table(params: list[Any]) -> list[str]:
    rows = []
    for param in params:
        is_option = _is_option(param)
        names = ", ".join(f"`{name}`" for name in param.opts) if is_option else f"`{_argument(param)}`"
        if is_option and not param.is_flag and param.metavar:
            names += f" {_escaped(param.metavar)}"
        default = param.default
        told = "required" if param.required else ""
        if is_option and not param.is_flag and not callable(default) and default not in (None, False):
            told = f"`{default}`"
        rows.append(f"| {names} | {_escaped(_text(param.help or ''))} | {told} |")
    return ["| option | what | default |", "|---|---|---|", *rows] if rows else []


def parameters_page() -> str:
    """Every parameter: default, unit, bounds, and where the value comes from."""
    lines = [
        "# Parameters",
        "",
        "Each can be changed by `--set BLOCK.NAME=VALUE` or in a file for `--config`, see "
        "[Parameters and methods](../howto/parameters.md). The values used stand in `summary.json`.",
    ]
    rows = describe_parameters()
    for block in dataclasses.fields(Parameters):
        about = (type(getattr(Parameters(), block.name)).__doc__ or "").strip().splitlines()[0]
        lines += ["", f"## {block.name}", "", about, "", "| name | default | unit | why | bounds |"]
        lines.append("|---|---|---|---|---|")
        for row in (each for each in rows if each["block"] == block.name):
            lines.append(
                f"| `{row['name']}` | {_value(row['default'])} | {_escaped(row['unit'])} | "
                f"{_escaped(row['why'])} | {_bounds(row)} |"
            )
    return "\n".join(lines) + "\n"


def _value(value: float | str) -> str:
    return f"`{value:.6g}`" if isinstance(value, float) else f"`{value}`"


def _bounds(row: dict[str, Any]) -> str:
    if "choices" in row:
        return ", ".join(f"`{name}`" for name in row["choices"])
    low, high = row["low"], row["high"]
    return f"{low:.6g} or more" if high == float("inf") else f"{low:.6g} to {high:.6g}"


def tables_page() -> str:
    """Every column of every table, as the files' own metadata tells it."""
    lines = [
        "# Tables",
        "",
        "All tables are Parquet. Lengths are meters in the frame of the map, or as the column says. The "
        "files hold these descriptions as well: `pyarrow.parquet.read_schema(path).field(name).metadata`.",
    ]
    for name, (schema, about) in TABLES.items():
        lines += ["", f"## {name}", "", about, "", "| column | type | meaning |", "|---|---|---|"]
        lines += [f"| `{field.name}` | {_type(field)} | {_escaped(_meaning(field))} |" for field in schema]
    return "\n".join(lines) + "\n"


def _type(field: pa.Field) -> str:
    kind = f"list of {field.type.value_type}" if pa.types.is_list(field.type) else str(field.type)
    return f"{kind}, may be null" if field.nullable else kind


def _meaning(field: pa.Field) -> str:
    return str(field.metadata[b"description"].decode())


def _text(markup: str) -> str:
    """Turn the markup of the terminal's help into Markdown."""
    return re.sub(r"\[bold\](.*?)\[/bold\]", r"`\1`", markup.strip())


def _escaped(text: str) -> str:
    """Keep a text within its cell of a table, and what stands in angle brackets on the page."""
    outside_code = re.split(r"(`[^`]*`)", text)
    escaped = [
        part if part.startswith("`") else part.replace("<", "&lt;").replace("*", "\\*")
        for part in outside_code
    ]
    return "".join(escaped).replace("|", "\\|")


PAGES: dict[str, Callable[[], str]] = {
    "reference/commands.md": commands_page,
    "reference/parameters.md": parameters_page,
    "reference/tables.md": tables_page,
}


def on_files(files: Any, config: Any, **_: Any) -> Any:
    """Add the pages to those that MkDocs builds."""
    from mkdocs.structure.files import File

    for name, page in PAGES.items():
        files.append(File.generated(config, name, content=page()))
    return files


if __name__ == "__main__":
    sys.stdout.write(PAGES[sys.argv[1]]())
