"""A batch of many logs, by the tool that counts what it takes."""

from __future__ import annotations

import re
from pathlib import Path

import measure_fleet

LOGS = 40


def test_files_and_memory_for_each_log(tmp_path: Path, capfd):
    """The same files for each log, nothing besides; the second call leaves all as it is."""
    assert measure_fleet.main(["many", "--logs", str(LOGS), "-o", str(tmp_path)]) == 0
    told = capfd.readouterr().out
    below = [int(number) for number in re.findall(r"below \w+/: (\d+)", told)]
    places = ("logs/run_000000/*", "tables/*/log=run_000000/*")
    of_one = [len(list((tmp_path / "out").glob(place))) for place in places]
    assert below == [LOGS * each for each in of_one]
    assert told.count("s of processor time") == 2
    assert not [path for path in (tmp_path / "out" / ".batch").iterdir() if path.name != "lock"]
