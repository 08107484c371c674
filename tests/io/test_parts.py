"""Maps that are not of one run are told of and kept apart."""

import numpy as np
import pytest
from reader_logs import SHARED, START_NS, Map, McapLog

from rose2_logs.errors import LogError
from rose2_logs.io import open_log
from rose2_logs.system.warnings import StrictError, collect_warnings


def seen(columns, width=200, wall=100):
    """A room of which more and more is seen."""
    cells = np.full((100, width), -1, np.int8)
    cells[10:90, 5:columns] = 0
    cells[[9, 90], 5:columns] = wall
    return cells


def log_of(path, maps):
    log = McapLog(path)
    for k, each in enumerate(maps):
        log.add("/map", START_NS + k * 10**9, each if isinstance(each, Map) else Map(each))
    return log.close()


def read(path, **options):
    with collect_warnings() as found, open_log(path, **options) as reader:
        free = [int((each.cells == 0).sum()) // 80 for each in reader.snapshots()]
        return free, reader.decided.get("part"), found.kinds


GROWING = [50, 80, 110, 140, 170]


def test_two_publishers_are_kept_apart_and_the_one_that_grows_is_read(tmp_path):
    pairs = [(Map(seen(columns)), Map(seen(140, 150))) for columns in GROWING]
    path = log_of(tmp_path / "run.mcap", [each for pair in pairs for each in pair])
    free, part, kinds = read(path)
    assert free == [columns - 5 for columns in GROWING]
    assert part == {"number": 1, "count": 2}
    (told,) = kinds["parts"].first
    assert "as of several publishers" in told["message"]
    assert "part=2 takes another" in told["message"]
    assert read(path, part=2) == ([135], {"number": 2, "count": 2}, {})
    with pytest.raises(LogError, match="has no part 3; it has 2"):
        read(path, part=3)
    with pytest.raises(StrictError), collect_warnings(strict=True), open_log(path) as reader:
        reader.first()


def test_a_map_that_is_begun_anew_is_a_part_of_its_own(tmp_path):
    path = log_of(tmp_path / "run.mcap", [seen(columns) for columns in (*GROWING, *GROWING[:4])])
    free, part, kinds = read(path)
    assert free == [columns - 5 for columns in GROWING]
    assert part == {"number": 1, "count": 2}
    assert "the map is begun anew" in kinds["parts"].first[0]["message"]
    assert read(path, part=2)[0] == [columns - 5 for columns in GROWING[:4]]


def test_the_place_where_a_map_is_begun_anew_is_found_in_a_long_log(tmp_path):
    columns = [*range(30, 190), *range(20, 150)]
    path = log_of(tmp_path / "run.mcap", [seen(each) for each in columns])
    assert read(path)[0] == [each - 5 for each in columns[:160]]
    assert read(path, part=2)[0] == [each - 5 for each in columns[160:]]


def grown(columns, left):
    """The same, cropped to what is known."""
    cells = seen(columns)[:, left:]
    return Map(cells, origin=(left * 0.05, 0.0))


@pytest.mark.parametrize(
    "maps",
    [
        [seen(each) for each in GROWING],
        # One bad map between others, and a map that loses a third to a loop closure.
        [seen(each) for each in (110, 140, 30, 140, 170)],
        [seen(each) for each in (110, 170, 120, 130)],
        # A grid that goes back and forth while the map stays what it is.
        [
            grown(columns, left)
            for columns, left in zip((100, 101, 102, 103, 104, 105), (0, 4) * 3, strict=True)
        ],
    ],
)
def test_maps_of_one_run_are_one_part(maps, tmp_path):
    free, part, kinds = read(log_of(tmp_path / "run.mcap", maps))
    assert len(free) == len(maps)
    assert part is None
    assert not kinds


@pytest.mark.skipif(not (SHARED / "faults").is_dir(), reason="needs ../shared/faults")
@pytest.mark.parametrize(("name", "number"), [("two_publishers", 1), ("reset_moved", 2), ("gazebo_reset", 2)])
def test_parts_of_logs_as_users_have_them(name, number):
    with collect_warnings() as found, open_log(SHARED / "faults" / f"{name}.mcap") as reader:
        free = [int((each.cells == 0).sum()) for each in reader.snapshots()]
    assert free == [4862, 13862, 22448, 31130, 40130, 44896]
    assert reader.decided["part"] == {"number": number, "count": 2}
    assert found.kinds["parts"].count == 1
