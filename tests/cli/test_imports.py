"""What the command line imports: no more than what was asked for needs, for that is what its start costs."""

from __future__ import annotations

import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest

from rose2_logs.cli.main import COMMANDS, commands

SAMPLE_LOGS = Path(__file__).parents[2] / "sample_logs"
ANALYSIS = ["scipy", "sklearn", "skimage", "rose2_logs.segmentation", "rose2_logs.runs"]
OUTPUTS = ["pyarrow", "rerun", "ezdxf", "jinja2", "rosbags", "distributed", "fsspec", "matplotlib"]
OF_NO_HELP = ["numpy", "shapely", "cv2", "mcap", "yaml", "rose2_logs.io", "rose2_logs.workflows"]
OF_OTHER_TYPERS = ["pydantic"]
OF_RICH_HELP = ["typer.rich_utils", "rich.markdown", "rich.traceback"]
OF_ALL_RICH = ["rich.progress"]
if tuple(map(int, version("typer").split(".")[:2])) >= (0, 28):
    OF_ALL_RICH += OF_RICH_HELP  # older versions of Typer load all that draws help at once
OTHER_COMMANDS = ["rose2_logs.cli.commands", "rose2_logs.config", "rose2_logs.batch"]


def imported(*arguments: object) -> set[str]:
    """Names of the modules that a command has imported when it ends."""
    program = (
        f"import sys, runpy; sys.argv = ['rose2-logs', *{[str(each) for each in arguments]!r}]\n"
        "try: runpy.run_module('rose2_logs', run_name='__main__')\n"
        "except SystemExit as ended: print('IMPORTED', ended.code or 0, *sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    code, *names = done.stdout.split("IMPORTED ")[1].split()
    assert code == "0", done.stderr
    return set(names)


@pytest.mark.parametrize("arguments", [["--help"], ["-h"], ["--version"]])
def test_the_list_of_commands_needs_none_of_them(arguments: list[str]):
    forbidden = {*ANALYSIS, *OUTPUTS, *OF_NO_HELP, *OF_ALL_RICH, *OTHER_COMMANDS}
    assert forbidden & imported(*arguments) == set()


@pytest.mark.parametrize("command", COMMANDS)
def test_the_help_of_a_command_needs_what_declares_its_options_alone(command: str):
    names = imported(command, "--help")
    assert {*ANALYSIS, *OUTPUTS, *OF_NO_HELP, *OF_ALL_RICH} - {"rose2_logs.workflows"} & names == set()
    modules = {name for name in names if name.startswith("rose2_logs.cli.commands.")}
    assert modules == {f"rose2_logs.cli.commands.{COMMANDS[command][0]}"}


@pytest.mark.parametrize("log", ["office.mcap", "wing.bag", "ring"])
def test_looking_at_a_log_needs_nothing_that_analyzes_or_writes(log: str):
    names = imported("info", SAMPLE_LOGS / log)
    assert "numpy" in names
    assert {*ANALYSIS, *OUTPUTS, "shapely", "cv2", *OF_ALL_RICH, *OF_OTHER_TYPERS} & names == set()


def test_the_list_tells_of_each_command_what_its_own_help_tells():
    assert {name: about for name, (_, about) in COMMANDS.items()} == {
        name: command.help for name, command in commands().items()
    }
