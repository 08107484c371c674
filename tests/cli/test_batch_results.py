"""What ``batch`` prints at its end."""

from __future__ import annotations

from pathlib import Path

import pytest

from rose2_logs.batch.dataset import failed_row
from rose2_logs.batch.driver import BatchResult, LogState
from rose2_logs.cli.commands.batch import MOST_ROWS, print_batch


def result_of(logs: int, failed: int) -> BatchResult:
    """A batch of so many logs, of which every so-manyth failed."""
    states = []
    for number in range(logs):
        name = f"run_{number:06}"
        is_bad = number % (logs // failed) == 0
        row = failed_row(name, f"/data/{name}.mcap", "broken") | (
            {} if is_bad else {"reason": "", "run_s": 1.0}
        )
        states.append(LogState(name, "failed" if is_bad else "done", row))
    return BatchResult("/results", tuple(states), (Path("/results/summary.csv"),))


@pytest.mark.parametrize(
    ("logs", "failed", "lines"), [(20, 4, 20), (20_000, 4, 4), (20_000, 1000, MOST_ROWS)]
)
def test_a_large_batch_lists_what_failed(capsys, logs: int, failed: int, lines: int):
    """And no more than can be looked through; it says how many are not listed."""
    print_batch(result_of(logs, failed))
    told = capsys.readouterr().out
    assert sum(line.startswith("run_") for line in told.splitlines()) == lines
    assert f"{logs - failed} done, {failed} failed" in told
    assert (f"{logs - lines} logs not listed here" in told) == (logs > lines)
