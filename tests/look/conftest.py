"""Results opened in the programs that people open them with; `.ci/look` installs these and runs the tests."""

from __future__ import annotations

from pathlib import Path

import pytest
from finished_runs import SAMPLE_LOGS
from programs import PROGRAMS

from rose2_logs.config.run_options import RunOptions
from rose2_logs.workflows.analyze import analyze_log

HERE = Path(__file__).parent


def pytest_collection_modifyitems(items):
    """Mark the tests of this folder; elsewhere than in `.ci/look` they are skipped, whatever is installed."""
    for item in items:
        if HERE in item.path.parents:
            item.add_marker("look")
            if PROGRAMS is None:
                item.add_marker(pytest.mark.skip(reason="run by .ci/look"))


@pytest.fixture(scope="session")
def pictures() -> Path:
    """Folder for pictures of what programs show: named after the program and what it shows."""
    assert PROGRAMS is not None
    folder = PROGRAMS / "pictures"
    folder.mkdir(exist_ok=True)
    return folder


def _analyzed(log: Path):
    def make(folder: Path) -> None:
        analyze_log(log, folder, RunOptions(recording=False, bag=True))

    return make


@pytest.fixture(scope="session")
def wing(made_once) -> Path:
    """Results of a whole ROS 1 bag whose map is latched, as a ROS 2 bag."""
    return made_once("look_wing", _analyzed(SAMPLE_LOGS / "wing.bag"))


@pytest.fixture(scope="session")
def office(made_once) -> Path:
    """Results of a whole MCAP whose quality of service is recorded, as a ROS 2 bag."""
    return made_once("look_office", _analyzed(SAMPLE_LOGS / "office.mcap"))
