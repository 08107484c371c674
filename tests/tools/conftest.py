"""A building and its exploration, for the tests of several tools."""

from __future__ import annotations

import pytest


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
