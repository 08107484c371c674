"""Help of the command line, drawn with the parts of Rich that load quickly.

Typer's own brings Markdown, syntax colors and tracebacks along, which takes longer than all the rest.
"""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.highlighter import RegexHighlighter
from rich.markup import escape
from rich.padding import Padding
from rich.panel import Panel
from rich.table import Table
from rich.text import Text
from rich.theme import Theme
from typer.core import TyperCommand, TyperGroup, TyperOption

THEME = Theme({"help.option": "bold cyan", "help.switch": "bold green", "help.usage": "yellow"})
VALUE, REQUIRED, TOLD, BORDER = "bold yellow", "red", "dim", "dim"
"""Styles: what an option takes, the mark of what must be given, defaults and bounds, frames."""


class _Options(RegexHighlighter):
    base_style = "help."
    highlights = (
        r"(^|\W)(?P<switch>-\w)(?!\w)",
        r"(^|\W)(?P<option>--[\w-]+)",
        r"(?P<usage>^Usage: )",
    )


_colored = _Options()


class Command(TyperCommand):
    """A command whose help is drawn here, and whose options take a value once, but for those for several."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Refuse what is given twice: of two values one would be left out without a word."""
        if ctx.resilient_parsing:  # of what is typed so far, to complete it
            return super().parse_args(ctx, args)
        _, _, given = self.make_parser(ctx).parse_args(args=list(args))
        for each in given:
            takes_one = isinstance(each, TyperOption) and not (each.multiple or each.is_flag)
            if takes_one and given.count(each) > 1:
                ctx.fail(f"{each.opts[0]} is given more than once; it takes one value")
        return super().parse_args(ctx, args)

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Print the help."""
        print_help(self, ctx)


class Group(TyperGroup):
    """Commands whose help is drawn here."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Print the help."""
        commands = {name: self.about(ctx, name) for name in self.list_commands(ctx)}
        print_help(self, ctx, commands)

    def about(self, ctx: Any, name: str) -> str:
        """Return what a command does, in one line."""
        command = self.get_command(ctx, name)
        return "" if command is None else command.help or ""


def print_help(command: Any, ctx: Any, commands: dict[str, str] | None = None) -> None:
    """Print the help of a command: usage, what it does, its options in groups, commands, examples.

    Parameters
    ----------
    command : TyperCommand or TyperGroup
        The command.
    ctx : Context
        In which it was called.
    commands : dict of str to str, optional
        Commands that belong to it, and what each does.
    """
    console = Console(theme=THEME, highlighter=_colored)
    console.print(Padding(_colored(command.get_usage(ctx)), 1), style="bold")
    if command.help:
        console.print(Padding(_text(command.help), (0, 1, 1, 1)))
    panels: dict[str, list[Any]] = {"Arguments": [], "Options": []}
    for each in command.get_params(ctx):
        kind = "Arguments" if each.param_type_name == "argument" else "Options"
        panels.setdefault(getattr(each, "rich_help_panel", None) or kind, []).append(each)
    for title, members in panels.items():
        _print_panel(console, title, [_row(each, ctx) for each in members])
    names = [[Text(name, "bold cyan"), _text(about)] for name, about in (commands or {}).items()]
    _print_panel(console, "Commands", names)
    if command.epilog:
        console.print(Padding(_text(command.epilog), 1))


def _text(markup: str) -> Text:
    return _colored(Text.from_markup(markup))


def _row(param: Any, ctx: Any) -> list[Text]:
    """Cells of an argument or an option: whether it is required, its names, its value, what it is for."""
    about, given = param.help or "", param.get_help_record(ctx)[1]
    # Typer has these in brackets behind the text.
    told = given.removeprefix(about).strip()
    line = _text(about)
    if told:
        line.append_text(Text(f" {told}" if about else told, TOLD))
    mark = Text("*" if param.required else "", REQUIRED)
    if param.param_type_name == "argument":
        return [mark, Text(param.metavar or param.name.upper(), VALUE), Text(), Text(), line]
    long = ",".join(name for name in param.opts if name.startswith("--"))
    short = ",".join(name for name in param.opts if not name.startswith("--"))
    value = Text("" if param.is_flag else param.metavar or "", VALUE, overflow="fold")
    return [mark, _colored(long), _colored(short), value, line]


def _print_panel(console: Console, title: str, rows: list[list[Text]]) -> None:
    """Print rows within a frame, without the columns that are empty in all of them."""
    if not rows:
        return
    table = Table(box=None, show_header=False, pad_edge=False, padding=(0, 1))
    kept = [number for number, cells in enumerate(zip(*rows, strict=True)) if any(cells)]
    for row in rows:
        table.add_row(*(row[number] for number in kept))
    console.print(Panel(table, border_style=BORDER, title=escape(title), title_align="left"))
