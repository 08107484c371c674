from pathlib import Path

import pytest
from carmen_lines import robot_laser
from rosbags.highlevel import AnyReader

from rose2_logs.errors import LogError

SHARED = Path(__file__).parents[3] / "shared" / "carmen"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("PARAM a 1 nohost 0\n", "no ROBOTLASER1 or FLASER"),
        (robot_laser(1, 0, [1, 2, 3])[:60] + "\n", "line 1 is no whole ROBOTLASER1"),
    ],
)
def test_a_log_without_whole_scans_is_refused_in_one_line(tmp_path, text, message, capsys):
    from carmen_to_bag import main

    from rose2_logs.io.carmen import read_carmen

    log = tmp_path / "a.log"
    log.write_text(text)
    with pytest.raises(LogError, match=message):
        read_carmen(log)
    assert main([str(log), str(tmp_path / "out.mcap")]) == 1
    assert capsys.readouterr().err.count("\n") == 1
    assert not (tmp_path / "out.mcap").exists()


def test_a_map_is_written_for_every_interval_that_has_scans(tmp_path):
    from carmen_to_bag import main

    log = tmp_path / "a.log"
    log.write_text("".join(robot_laser(t, 0, [1, 2, 3]) for t in (100, 101, 104.5, 112, 120)))
    assert main([str(log), str(tmp_path / "out.bag"), "--every", "5"]) == 0
    with AnyReader([tmp_path / "out.bag"]) as reader:
        maps = [c for c in reader.connections if c.topic == "/map"]
        times = [time / 1e9 for _, time, _ in reader.messages(maps)]
    assert times == [105, 115, 120]


@pytest.mark.parametrize("name", ["belgioioso-corrected.log.gz", "fr079.log.gz"])
@pytest.mark.skipif(not SHARED.exists(), reason="needs the CARMEN logs in ../shared beside the project")
def test_real_logs_give_twenty_to_sixty_growing_maps(tmp_path, name):
    from carmen_to_bag import main

    target = tmp_path / "run.mcap"
    assert main([str(SHARED / name), str(target)]) == 0
    with AnyReader([target]) as reader:
        maps = [c for c in reader.connections if c.topic == "/map"]
        grids = [reader.deserialize(raw, c.msgtype) for c, _, raw in reader.messages(maps)]
    assert 20 <= len(grids) <= 60
    free = [int((grid.data == 0).sum()) for grid in grids]
    assert free[-1] > 3 * free[0]
    assert 0.0025 * free[-1] > 250  # square meters of floor: no building is smaller than that
