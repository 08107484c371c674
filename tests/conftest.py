"""What holds for all tests, and a run that several of them read."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from commands import heed_ctrl_c, nothing_left_behind
from filelock import FileLock
from finished_runs import SAMPLE_LOGS, run_of
from hypothesis import HealthCheck, settings

from rose2_logs.system.warnings import PACKAGE

heed_ctrl_c()

# No property fails because the machine is slow or busy. Where CI is set, as by .ci/run, the same examples
# are tried each time: a failure there is of the change at hand and can be had again. Elsewhere they are new.
settings.register_profile(
    "rose2_logs",
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow],
    derandomize=bool(os.environ.get("CI")),
    database=None,
    print_blob=True,
)
settings.load_profile("rose2_logs")


@pytest.fixture(scope="session", autouse=True)
def _nothing_left_behind() -> Iterator[None]:
    """Tests end what they start."""
    with nothing_left_behind():
        yield


@pytest.fixture(autouse=True)
def _messages_as_before() -> Iterator[None]:
    """Let a test that calls the command line leave the package's logger as it was."""
    logger = logging.getLogger(PACKAGE)
    handlers, level, propagates = logger.handlers, logger.level, logger.propagate
    yield
    logger.handlers, logger.propagate = handlers, propagates
    logger.setLevel(level)


@pytest.fixture(scope="session")
def made_once(tmp_path_factory) -> Callable[[str, Callable[[Path], object]], Path]:
    """Return a function that makes a folder, once for all processes that run the tests."""
    shared = tmp_path_factory.getbasetemp()
    if os.environ.get("PYTEST_XDIST_WORKER"):
        shared = shared.parent

    def folder_of(name: str, make: Callable[[Path], object]) -> Path:
        folder, done = shared / name, shared / f"{name}.made"
        with FileLock(shared / f"{name}.lock"):
            if not done.exists():
                make(folder)
                done.touch()
        return folder

    return folder_of


@pytest.fixture(scope="session")
def office_results(made_once) -> Path:
    """Results of six maps of a sample log; to be left as they are."""
    return (
        made_once("office_results", lambda folder: run_of(SAMPLE_LOGS / "office.mcap", folder / "office"))
        / "office"
    )
