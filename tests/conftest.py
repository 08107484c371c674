"""A run that several tests read."""

from __future__ import annotations

from pathlib import Path

import pytest
from finished_runs import SAMPLE_LOGS, run_of


@pytest.fixture(scope="session")
def office_results(tmp_path_factory) -> Path:
    """Results of six maps of a sample log; to be left as they are."""
    return run_of(SAMPLE_LOGS / "office.mcap", tmp_path_factory.mktemp("results") / "office")
