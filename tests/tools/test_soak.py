"""The tool that watches a long run, on a short one."""

from __future__ import annotations

from pathlib import Path

import pytest

from rose2_logs.workflows.analyze import RunOptions


@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="the kernel tells no open files here")
def test_a_long_log_changes_and_is_watched(tmp_path: Path):
    """Every map is distinct, a third changes what is free and occupied; a figure for each percent."""
    from soak import Sample, table, watch, write_long_log

    write_long_log(tmp_path / "long.mcap", 12)
    options = RunOptions(recording=False, annotated_log=False)
    result, samples = watch(tmp_path / "long.mcap", tmp_path / "out", 12, options)
    assert (result.summary.totals.snapshots, result.summary.totals.unchanged) == (12, 8)
    assert result.summary.totals.rooms_last == 4
    assert [sample.maps for sample in samples] == list(range(1, 13))
    assert all(sample.memory_bytes > 10e6 and sample.open_files > 2 for sample in samples)
    assert len(table(samples).splitlines()) == 7
    assert "| 12 | 2 | 3 | 4 |" in table([Sample(12, 2_000_000, 3, 4.0)])
