"""The README's first screen holds, and CI runs what it says."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

from rose2_logs.config.parameters import load_parameters

PROJECT = Path(__file__).parents[1]
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
