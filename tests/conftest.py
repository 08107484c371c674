"""What holds for all tests, and a run that several of them read."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from finished_runs import SAMPLE_LOGS, run_of
from hypothesis import settings

from rose2_logs.system.warnings import PACKAGE

# Where CI is set, as by .ci/run, properties are tried on the same examples each time, however slow the
# machine is: a failure there is of the change at hand and can be had again. Elsewhere there are new ones.
settings.register_profile("ci", derandomize=True, deadline=None, database=None, print_blob=True)
if os.environ.get("CI"):
    settings.load_profile("ci")


@pytest.fixture(autouse=True)
def _messages_as_before() -> Iterator[None]:
    """Let a test that calls the command line leave the package's logger as it was."""
    logger = logging.getLogger(PACKAGE)
    handlers, level, propagates = logger.handlers, logger.level, logger.propagate
    yield
    logger.handlers, logger.propagate = handlers, propagates
    logger.setLevel(level)


@pytest.fixture(scope="session")
def office_results(tmp_path_factory) -> Path:
    """Results of six maps of a sample log; to be left as they are."""
    return run_of(SAMPLE_LOGS / "office.mcap", tmp_path_factory.mktemp("results") / "office")
