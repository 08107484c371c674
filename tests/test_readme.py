"""The README's first screen holds, and CI runs what it says."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import yaml

import rose2_logs
from rose2_logs.config.parameters import load_parameters

PROJECT = Path(__file__).parents[1]
PACKAGE = PROJECT / "rose2_logs"
README = (PROJECT / "README.md").read_text(encoding="utf-8")


def shell_commands() -> list[str]:
    return [block.strip() for block in re.findall(r"```sh\n(.*?)```", README, re.DOTALL)]


def test_there_are_two_commands_main_job_first():
    """One line installs and analyzes a sample log that exists, the next installs and runs the tests."""
    main_job, tests = shell_commands()
    assert "\n" not in main_job + tests
    (log,) = re.findall(r"analyze (\S+)", main_job)
    assert (PROJECT / log).exists()
    assert tests.endswith("pytest -n 2")


def test_ci_takes_its_test_command_from_the_readme():
    """The pattern by which CI finds the command finds exactly that one."""
    (pattern,) = re.findall(
        r"command=\$\(grep -E '([^']+)' README.md\)", (PROJECT / ".ci" / "run").read_text()
    )
    assert re.findall(pattern + ".*", README, re.MULTILINE) == [shell_commands()[1]]


def test_the_parameter_in_the_readme_exists():
    """The example of --set can be copied."""
    (setting,) = re.findall(r"--set (\w+\.\w+=\S+?)`", README.replace("stage.name=value", ""))
    assert load_parameters(None, [setting]) != load_parameters()


def test_ci_is_sound_shell():
    """CI's script parses."""
    subprocess.run(["bash", "-n", PROJECT / ".ci" / "run"], check=True)


def test_the_citation_is_of_this_version():
    """As `pip show` says it."""
    citation = yaml.safe_load((PROJECT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["version"] == rose2_logs.__version__


def test_what_the_architecture_names_is_there():
    """Folders and modules of the table and of the answers, and the names in them."""
    text = (PROJECT / "ARCHITECTURE.md").read_text(encoding="utf-8")
    paths = {path for path in re.findall(r"`([a-z_0-9/]+(?:/|\.py))`", text) if "/" in path}
    missing = [
        path
        for path in paths
        if not any((root / path).exists() for root in (PACKAGE, PROJECT, *PACKAGE.iterdir()))
    ]
    assert missing == []
    assert len(paths) > 25
    code = "".join(path.read_text(encoding="utf-8") for path in PACKAGE.rglob("*.py"))
    names = re.findall(r"`(?:\w+\.)?(_?[A-Z]\w+|_[a-z_]+|[a-z]+_[a-z_]+)`", text)
    assert [name for name in names if name not in code and not (PACKAGE / name).exists()] == []
