"""The developers' tools are no package: their folder goes on the path, as it does when one of them runs."""

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "tools"))


@pytest.fixture(scope="session")
def flat():
    """A small building, quick to explore."""
    from simulation.make_building import simulate_building

    return simulate_building(6, "flat")


@pytest.fixture(scope="session")
def flat_run(flat):
    """Its exploration."""
    from simulation.exploration import explore

    return list(explore(flat, 6, map_every_s=10.0))
