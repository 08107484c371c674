"""Options of the command line are those of the library, which itself knows nothing of flags."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest
from finished_runs import SAMPLE_LOGS

from rose2_logs.batch.options import BatchOptions
from rose2_logs.cli.flags import flag_of, with_flags
from rose2_logs.cli.main import commands
from rose2_logs.config.run_options import RunOptions, options_of

PACKAGE = Path(__file__).parents[2] / "rose2_logs"
COMMANDS = commands()
OTHERS = [path for path in sorted(PACKAGE.rglob("*.py")) if not path.is_relative_to(PACKAGE / "cli")]


def flags(command: str) -> set[str]:
    return {flag for each in COMMANDS[command].params for flag in each.opts if flag.startswith("-")}


@pytest.mark.parametrize(
    ("kind", "name", "command"),
    [
        (kind, name, command)
        for kind in (RunOptions, BatchOptions)
        for name, about in options_of(kind).items()
        for command in about.commands
    ],
)
def test_help_shows_each_option(cli, kind: type, name: str, command: str):
    code, out, _ = cli(command, "--help")
    assert (code, f"{flag_of(name, options_of(kind)[name])} " in out) == (0, True)


def test_commands_have_no_option_that_is_not_theirs():
    assert "--live" in flags("analyze") - flags("batch")
    assert "--scheduler" in flags("batch") - flags("analyze")


@pytest.mark.parametrize("name", ["origin", "journal"])
def test_options_for_programs_have_no_flag(name: str):
    assert f"--{name}" not in flags("analyze") | flags("batch")


def texts(path: Path) -> list[str]:
    """Texts in a module: not its docstrings, and no word alone, as an argument of another program is."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    told = {id(each.value) for each in ast.walk(tree) if isinstance(each, ast.Expr)}
    strings = [each for each in ast.walk(tree) if isinstance(each, ast.Constant) and id(each) not in told]
    return [each.value for each in strings if isinstance(each.value, str) and " " in each.value]


def test_no_message_of_the_library_names_a_flag():
    known = set().union(*(flags(command) for command in COMMANDS))
    naming = [
        f"{path.relative_to(PACKAGE).as_posix()}: {text}"
        for path in OTHERS
        for text in texts(path)
        if known.intersection(re.findall(r"(?<![\w-])(?<!ulimit )--?[a-z][a-z-]*", text))
    ]
    assert not naming, "\n".join(naming)


@pytest.mark.parametrize(
    ("message", "shown"),
    [
        ("choose another folder or allow overwriting (overwrite=True)", "(--overwrite)"),
        ("analyze it again without annotated_log=False", "without --no-mcap"),
        ("choose one (topic='/map')", "(--topic '/map')"),
        ("start_s=nan: it must be", "--start nan: it must be"),
        ("raise the parameter reading.map_max_cells", "raise --set reading.map_max_cells"),
        ("setting 'detail=2': write it as", "setting 'detail=2': write it as"),
        ("base_frame=NAME names it, of map", "--base-frame NAME names it, of map"),
        ("the map is built in odom (map_frame= names another frame)", "(--map-frame  names another frame)"),
        ("detail=1e-05: only method='rose2' has it", "--detail 1e-05: only --method 'rose2' has it"),
        ("its map_server's origin; choose one (topic='/map')", "origin; choose one (--topic '/map')"),
        *(
            (told, told)
            for told in (
                "/data/topic=7/run.mcap: cannot be read",
                "x-topic=y,detail=2.mcap: no such file or directory",
                "my topic=y detail=2.mcap: no such file or directory",
                "overwrite=True.mcap: no such file or directory",
                "setting 'regions.detail=1,5': write it as block.name=value",
                "no group 'of detail=2'; there are: a",
                "names 'it\\'s detail=2' twice",
                "no parameter block \"it's the parameter walls.x and topic='/a'\"",
            )
        ),
    ],
)
def test_messages_name_options_as_flags_on_the_command_line(message: str, shown: str):
    assert with_flags(message).endswith(shown) or with_flags(message).startswith(shown)


def test_what_an_option_lacks_is_named_as_a_flag(cli, tmp_path: Path):
    code, _, err = cli("analyze", SAMPLE_LOGS / "office.mcap", "-o", tmp_path / "out", "--map-frame", "odom")
    assert code == 2
    assert "is for maps built from scans; give their topic, too (--map-from '/scan')" in err


def test_one_definition_makes_option_and_value(cli, tmp_path: Path):
    """A flag that turns off what is on by default does."""
    _, _, err = cli("analyze", tmp_path / "x.bag", "-o", tmp_path, "--bag", "--no-mcap", "--no-rrd")
    assert "--bag makes a ROS 2 bag" in err


@pytest.mark.parametrize("command", ["batch", "analyze"])
def test_an_option_for_one_value_is_given_once(cli, tmp_path: Path, command: str):
    """Of two one would be left out without a word; flags say the same twice."""
    where = ("-o", tmp_path / "one", "--out", tmp_path / "two")
    code, _, err = cli(command, SAMPLE_LOGS / "office.mcap", *where, "-q", "-q")
    assert code == 2
    assert "--out is given more than once; it takes one value" in err
    assert list(tmp_path.iterdir()) == []
