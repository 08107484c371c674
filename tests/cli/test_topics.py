"""Several map topics of a log are analyzed in one go, each to a folder of its own."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from reader_logs import SHARED, START_NS, Map, McapLog, Text, serialized

import rose2_logs as rl
from rose2_logs.errors import NoMapTopicError

TOPICS = {"/map": 90, "/a/map": 50, "/a_map": 70}
QUIET = ("--no-rrd", "--no-mcap")


def test_what_has_no_schema_is_told_with_the_option_that_reads_it(cli, tmp_path: Path):
    """By info, by analyze, and in the table of batch."""
    log = McapLog(tmp_path / "run.mcap")
    log.raw("/map", START_NS, ("", "", b""), "cdr", serialized(Map(np.zeros((60, 100), np.int8)), 2))
    path = log.close()
    code, out, _ = cli("info", path)
    assert (code, "if those on /map are maps, analyze --type nav_msgs/OccupancyGrid" in out) == (0, True)
    code, out, err = cli("batch", path, "-o", tmp_path / "batch", *QUIET)
    assert code == 2
    for told in (out, err):
        assert "--type" in told
        assert "message_type" not in told


@pytest.fixture
def log(tmp_path: Path) -> Path:
    log = McapLog(tmp_path / "run.mcap")
    log.add("/chatter", START_NS, Text("hello"))
    for k, (topic, columns) in enumerate(TOPICS.items(), start=1):
        cells = np.full((60, 100), 100, np.int8)
        cells[5:55, 5:columns] = 0
        log.add(topic, START_NS + k, Map(cells))
    return log.close()


def topics_in(folder: Path) -> dict[str, str]:
    """Topic of each folder of results."""
    found = {path.parent: json.loads(path.read_text("utf-8")) for path in folder.rglob("summary.json")}
    return {path.relative_to(folder).as_posix(): summary["topic"] for path, summary in found.items()}


def test_each_of_several_topics_has_its_own_folder(cli, log: Path, tmp_path: Path):
    asked = ("--topic", "/a/map", "--topic", "/map", "--topic", "/a/map")
    code, _, err = cli("analyze", log, "-o", tmp_path / "two", *asked, *QUIET)
    assert (code, err) == (0, "")
    assert topics_in(tmp_path / "two" / "run") == {"a_map": "/a/map", "map": "/map"}
    code, _, err = cli("analyze", log, "-o", tmp_path / "all", "--all-topics", *QUIET)
    assert (code, err) == (0, "")
    names = topics_in(tmp_path / "all" / "run")
    assert sorted(names.values()) == sorted(TOPICS)
    assert set(names) == {"map", "a_map", "a_map_2"}
    free = {
        topic: rl.load(tmp_path / "all" / "run" / name).snapshots["free_area_m2"].tolist()
        for name, topic in names.items()
    }
    assert free == {topic: [pytest.approx(50 * (right - 5) * 0.0025)] for topic, right in TOPICS.items()}
    assert cli("report", tmp_path / "all" / "run")[0] == 0
    assert (tmp_path / "all" / "run" / "report.html").exists()


def test_a_single_topic_has_the_folder_of_the_log(cli, log: Path, tmp_path: Path):
    assert cli("analyze", log, "-o", tmp_path / "one", "--topic", "a/map", *QUIET)[0] == 0
    assert topics_in(tmp_path / "one") == {"run": "/a/map"}


def test_a_topic_that_is_not_there_is_refused_before_the_others_are_analyzed(cli, log: Path, tmp_path: Path):
    out = tmp_path / "out"
    code, _, err = cli("analyze", log, "-o", out, "--topic", "/map", "--topic", "/b", *QUIET)
    assert code == 2
    assert err.startswith(f"error: {log}: /b is not a topic with occupancy grids")
    assert not out.exists()
    # Another log that has all of them is analyzed.
    more = McapLog(tmp_path / "more.mcap")
    for k, topic in enumerate(("/map", "/b")):
        more.add(topic, START_NS + k, Map(np.zeros((20, 20), np.int8)))
    both = ("--topic", "/map", "--topic", "/b", *QUIET)
    assert cli("analyze", log, more.close(), "-o", out, *both)[0] == 2
    assert topics_in(out) == {"more/map": "/map", "more/b": "/b"}


def test_one_topic_in_two_spellings_is_analyzed_once(cli, log: Path, tmp_path: Path):
    assert cli("analyze", log, "-o", tmp_path, "--topic", "map", "--topic", "/map", *QUIET)[0] == 0
    assert topics_in(tmp_path) == {"run": "/map"}


@pytest.mark.parametrize("other", ["--topic", "--map-from"])
def test_all_topics_and_one_exclude_each_other(cli, log: Path, tmp_path: Path, other: str):
    code, _, err = cli("analyze", log, "-o", tmp_path / "out", "--all-topics", other, "/map")
    assert (code, err) == (2, f"error: --all-topics and {other} exclude each other; pass one of them\n")
    assert not (tmp_path / "out").exists()


def test_topics_with_maps_are_listed(log: Path, tmp_path: Path):
    assert rl.map_topics(log) == sorted(TOPICS)
    none = McapLog(tmp_path / "none.mcap")
    none.add("/chatter", START_NS, Text("hello"))
    with pytest.raises(NoMapTopicError, match="no topic has occupancy grids"):
        rl.map_topics(none.close())


@pytest.mark.skipif(not (SHARED / "faults").is_dir(), reason="needs ../shared/faults")
def test_the_maps_of_two_robots_and_the_merged_one(cli, tmp_path: Path):
    log = SHARED / "faults" / "two_robots.mcap"
    assert cli("analyze", log, "-o", tmp_path, "--all-topics", *QUIET)[::2] == (0, "")
    names = {"map": "/map", "tb3_0_map": "/tb3_0/map", "tb3_1_map": "/tb3_1/map"}
    assert topics_in(tmp_path / "two_robots") == names
    for name in ("tb3_0_map", "tb3_1_map"):
        assert rl.load(tmp_path / "two_robots" / name).summary["results"]["rooms_last"] == 7


@pytest.mark.parametrize("several", ["topics", "all topics", "logs"])
def test_names_are_those_of_one_run(cli, log: Path, tmp_path: Path, several: str):
    """A track of one run is another room in the next."""
    names = tmp_path / "names.csv"
    names.write_text("name,track\nKitchen,1\n")
    other = tmp_path / "other.mcap"
    other.write_bytes(log.read_bytes())
    runs = {
        "topics": (log, "--topic", "/map", "--topic", "/a/map"),
        "all topics": (log, "--all-topics"),
        "logs": (log, other, "--topic", "/map"),
    }
    code, _, err = cli("analyze", *runs[several], "-o", tmp_path / "out", "--names", names, *QUIET)
    assert code == 2
    assert f"--names '{names}': is for the rooms of one run" in err
    assert not list(tmp_path.rglob("summary.json"))
    # A plan names rooms by where they are, and tells where it does not fit.
    plan = tmp_path / "plan.geojson"
    box = {"type": "Polygon", "coordinates": [[[0.3, 0.3], [2.4, 0.3], [2.4, 2.7], [0.3, 2.7], [0.3, 0.3]]]}
    feature = {"type": "Feature", "geometry": box, "properties": {"name": "Kitchen"}}
    plan.write_text(json.dumps({"type": "FeatureCollection", "features": [feature]}))
    _, _, err = cli("analyze", *runs[several], "-o", tmp_path / "out", "--names", plan, *QUIET)
    assert "is for the rooms of one run" not in err
