"""Pages of the documentation that are generated: commands, parameters, tables, and the notebook.

MkDocs calls `on_files` when it builds the site, see ``mkdocs.yml``. To read a page without building the site:

    python tools/docs_pages.py reference/parameters.md
"""

from __future__ import annotations

import base64
import dataclasses
import json
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow as pa
import typer

from rose2_logs.cli.main import app, commands
from rose2_logs.config.parameters import Parameters, describe_parameters
from rose2_logs.config.run_options import RunOptions, options_of
from rose2_logs.runs import table_schemas

NAME = "rose2-logs"
NOTEBOOK = Path(__file__).parents[1] / "docs" / "notebooks" / "tour.ipynb"
OPTIONS_MARK = "<!-- options of a run -->"
"""Where a page shows the options of a run."""
PICTURES = {"image/svg+xml": "svg", "image/png": "png"}
"""Kinds of pictures that a cell may put out, the preferred one first."""
TABLES = {
    "snapshots.parquet": (table_schemas.SNAPSHOTS, "One row per map."),
    "rooms.parquet": (table_schemas.ROOMS, "One row per room and map."),
    "tracks.parquet": (table_schemas.TRACKS, "One row per room over the run."),
    "events.parquet": (table_schemas.EVENTS, "One row per event."),
    "doorways.parquet": (table_schemas.DOORWAYS, "One row per doorway and map."),
    "borders.parquet": (table_schemas.BORDERS, "One row per pair of neighboring rooms and map."),
    "walls.parquet": (table_schemas.WALLS, "One row per wall segment and map."),
    "lines.parquet": (table_schemas.LINES, "One row per representative line and map."),
    "maps.parquet": (table_schemas.MAPS, "One row per map: its explored window and its label image."),
    "back_projected.parquet": (
        table_schemas.BACK_PROJECTED,
        "With `--back-project`: one row per room of the last map and map that shows some of it.",
    ),
    "room_changes.parquet": (
        table_schemas.ROOM_CHANGES,
        "Written by `compare`: one row per group of rooms that belong together, or per single room.",
    ),
    "wall_changes.parquet": (
        table_schemas.WALL_CHANGES,
        "Written by `compare`: one row per stretch of wall that differs.",
    ),
}


def commands_page() -> str:
    """Every command with its arguments and options, from its help."""
    group: Any = typer.main.get_command(app)
    lines = ["# Commands", "", _text(group.help), ""]
    lines += ["Exit codes: 0 done; 1 internal error; 2 a log, a file or an option cannot be used (one line"]
    lines += ["says which); 130 interrupted.", "", *_options_table(group.params)]
    for name, command in commands().items():
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
    return ["| option | meaning | default |", "|---|---|---|", *rows] if rows else []


def parameters_page() -> str:
    """Every parameter with its default, unit, bounds, and the reason for the default."""
    lines = [
        "# Parameters",
        "",
        "Change a parameter with `--set BLOCK.NAME=VALUE`, in a file for `--config`, or in Python with "
        '`parameters={"BLOCK.NAME": VALUE}`; see [Parameters and methods](../howto/parameters.md). '
        "`summary.json` contains the values that were used.",
    ]
    rows = describe_parameters()
    for block in dataclasses.fields(Parameters):
        about = (type(getattr(Parameters(), block.name)).__doc__ or "").strip().splitlines()[0]
        lines += ["", f"## {block.name}", "", about, "", "| name | default | unit | reason | bounds |"]
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
    """Every column of every table, from the metadata of the files."""
    lines = [
        "# Tables",
        "",
        "All tables are Parquet. Lengths are in meters in the frame of the map unless the column says "
        "otherwise. The files contain these descriptions, too: `rose2_logs.load(folder).rooms.columns`, or "
        "`pyarrow.parquet.read_schema(path).field(name).metadata`.",
        "",
        "`part` is 1 unless the map was begun anew within the log, or several nodes publish it: then each "
        "part has its own coverage and its own last map.",
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
    """Escape a text for a cell of a Markdown table."""
    outside_code = re.split(r"(`[^`]*`)", text)
    escaped = [
        part if part.startswith("`") else part.replace("<", "&lt;").replace("*", "\\*")
        for part in outside_code
    ]
    return "".join(escaped).replace("|", "\\|")


def options_table() -> str:
    """The options of a run as keywords of the Python functions."""
    lines = ["| option | type | default | meaning |", "|---|---|---|---|"]
    about = options_of(RunOptions)
    for each in dataclasses.fields(RunOptions):
        if each.default is dataclasses.MISSING:
            default = "`Parameters()`"
        else:
            default = "all" if about[each.name].text == "all" else f"`{each.default!r}`"
        kind = str(each.type).replace("|", "or")
        lines.append(f"| `{each.name}` | {_escaped(kind)} | {default} | {_escaped(about[each.name].help)} |")
    return "\n".join(lines)


def notebook_page() -> str:
    """The tutorial notebook with its outputs, as Markdown."""
    parts = []
    for number, cell in enumerate(_cells()):
        source = "".join(cell["source"])
        parts.append(source if cell["cell_type"] == "markdown" else f"```python\n{source}\n```")
        for place, output in enumerate(cell.get("outputs", [])):
            parts.append(_shown(output, number, place))
    return "\n\n".join(filter(None, parts)) + "\n"


def notebook_pictures() -> dict[str, bytes]:
    """The pictures that the notebook's cells put out, by their path in the documentation."""
    found = {}
    for number, cell in enumerate(_cells()):
        for place, output in enumerate(cell.get("outputs", [])):
            if kind := _picture_kind(output):
                data = "".join(output["data"][kind])
                content = base64.b64decode(data) if kind == "image/png" else data.encode()
                found[f"notebooks/{_picture_name(number, place, kind)}"] = content
    return found


def _cells() -> list[dict[str, Any]]:
    cells: list[dict[str, Any]] = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
    return cells


def _shown(output: dict[str, Any], number: int, place: int) -> str:
    if output["output_type"] == "stream":
        return "" if output["name"] == "stderr" else _as_text("".join(output["text"]))
    data = output.get("data", {})
    if kind := _picture_kind(output):
        return f"![Output of the cell above]({_picture_name(number, place, kind)})"
    if "text/html" in data:
        return _unindented("".join(data["text/html"]))
    return _as_text("".join(data["text/plain"])) if "text/plain" in data else ""


def _unindented(html: str) -> str:
    """One block of HTML, which Markdown leaves as it is if no line is empty or indented."""
    html = re.sub(r"<style.*?</style>", "", html, flags=re.DOTALL)
    html = html.replace('<table border="1" class="dataframe">', "<table>")
    return "\n".join(line.strip() for line in html.splitlines() if line.strip())


def _as_text(text: str) -> str:
    return f"```text\n{text.rstrip()}\n```"


def _picture_kind(output: dict[str, Any]) -> str | None:
    return next((kind for kind in PICTURES if kind in output.get("data", {})), None)


def _picture_name(number: int, place: int, kind: str) -> str:
    return f"tour_{number}_{place}.{PICTURES[kind]}"


PAGES: dict[str, Callable[[], str]] = {
    "reference/commands.md": commands_page,
    "reference/parameters.md": parameters_page,
    "reference/tables.md": tables_page,
    "notebooks/tour.md": notebook_page,
}


def on_files(files: Any, config: Any, **_: Any) -> Any:
    """Add the pages and the pictures of the notebook to what MkDocs builds."""
    from mkdocs.structure.files import File

    for name, page in PAGES.items():
        files.append(File.generated(config, name, content=page()))
    for name, picture in notebook_pictures().items():
        files.append(File.generated(config, name, content=picture))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Put the table of options where a page asks for it."""
    return markdown.replace(OPTIONS_MARK, options_table()) if OPTIONS_MARK in markdown else markdown


if __name__ == "__main__":
    sys.stdout.write(PAGES[sys.argv[1]]())
