"""Every command that README and documentation show can be typed as it stands."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

from rose2_logs.cli import main as command_line
from rose2_logs.outputs.mcap.ros_messages import ROOMS_TYPE, definition

PROJECT = Path(__file__).parents[2]
PAGES = [PROJECT / "README.md", *sorted((PROJECT / "docs").rglob("*.md"))]
BLOCK = re.compile(r"```(?:sh|text)\n(.*?)```", re.DOTALL)
INLINE = re.compile(r"`(?:\.venv/bin/)?(rose2-logs\s[a-z]+\s[^`]+)`")


def commands(page: Path) -> list[str]:
    """Those in blocks and in the text, without the names that stand for what the reader has."""
    text = page.read_text(encoding="utf-8")
    lines = [line for block in BLOCK.findall(text) for line in block.splitlines()]
    # A prompt or another command may stand before.
    shown = [
        line[line.index("rose2-logs ") :] for line in lines if re.search(r"(^|[ /])rose2-logs [a-z]", line)
    ]
    # A line of the text may be broken within a command.
    return shown + [" ".join(found.split()) for found in INLINE.findall(text)]


SHOWN = [(page.relative_to(PROJECT).as_posix(), command) for page in PAGES for command in commands(page)]


def test_commands_are_found():
    """In the README, the tutorial and the how-to pages."""
    pages = {page for page, _ in SHOWN}
    assert {"README.md", "docs/tutorial.md", "docs/howto/own-log.md", "docs/howto/other-programs.md"} <= pages
    assert len(SHOWN) > 40


def test_their_options_and_arguments_are_taken():
    """By the command line itself, which is not run."""
    known = command_line.commands()
    wrong = []
    for page, command in SHOWN:
        name, *words = shlex.split(command)[1:]
        try:
            known[name].make_context(name, words)
        except Exception as error:
            wrong.append(f"{page}: {command}: {error!r}")
    assert not wrong, "\n".join(wrong)


def test_the_page_on_formats_has_the_definition_that_is_written():
    formats = (PROJECT / "docs" / "formats.md").read_text(encoding="utf-8")
    shown = {tuple(line.partition("#")[0].split()) for line in formats.splitlines()}
    rooms, *used = definition(ROOMS_TYPE).decode().split("=" * 80 + "\n")
    own = [each.partition("\n")[2] for each in used if each.startswith("MSG: rose2_msgs/")]
    assert len(own) == 2
    for line in "".join([rooms, *own]).splitlines():
        assert tuple(line.split()) in shown, line
