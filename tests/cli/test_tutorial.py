"""The tutorial, followed as it is written: the tool prints what it says."""

from __future__ import annotations

import io
import re
import shlex
import sys
from pathlib import Path

import pandas as pd
import pytest

from rose2_logs.cli.main import main

PROJECT = Path(__file__).parents[2]
TUTORIAL = (PROJECT / "docs" / "tutorial.md").read_text(encoding="utf-8")
QUICKER = {"analyze": ["--no-rrd", "--no-mcap"], "compare": ["--no-rrd"]}
"""Leave out what the tutorial shows no text of."""


def words(text: str) -> list[str]:
    """Its lines, each with single spaces."""
    return [" ".join(line.split()) for line in text.splitlines()]


@pytest.fixture
def printed(tmp_path: Path, monkeypatch) -> str:
    """What its commands and programs print, but for those that install, or open a window."""
    (tmp_path / "sample_logs").symlink_to(PROJECT / "sample_logs")
    monkeypatch.chdir(tmp_path)
    out = io.StringIO()
    # Not `file`, whose value is where standard output goes at that time: it would be kept after the test.
    monkeypatch.setattr("rose2_logs.cli.printing._out._file", out)
    names: dict[str, object] = {"print": lambda text: out.write(f"{text}\n")}
    for language, block in re.findall(r"```(sh|python)\n(.*?)```", TUTORIAL, re.DOTALL):
        if language == "python":
            exec(block, names)
            continue
        for command in map(shlex.split, block.splitlines()):
            if command[0] == "rose2-logs" and command[1] != "view":
                monkeypatch.setattr(sys, "argv", [*command, *QUICKER.get(command[1], [])])
                with pytest.raises(SystemExit) as ended:
                    main()
                assert not ended.value.code, command
    assert isinstance(names["snapshots"], pd.DataFrame)
    return out.getvalue()


def test_the_tool_prints_what_the_tutorial_says(printed: str):
    """Each line of the outputs that it shows."""
    shown = words("".join(re.findall(r"```text\n(.*?)```", TUTORIAL, re.DOTALL)))
    assert len(shown) > 25
    assert [line for line in shown if line not in words(printed)] == []
