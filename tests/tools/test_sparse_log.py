"""A huge log that takes little space; `info` reads little more of it than its index."""

from __future__ import annotations

from itertools import islice
from pathlib import Path

import pytest
from mcap.reader import make_reader

from rose2_logs.workflows.info import describe_log

SAMPLE = Path(__file__).parents[2] / "sample_logs" / "office.mcap"
COUNTERS = Path("/proc/self/io")
MOST_READ = 10_000_000


def bytes_read() -> int:
    """What this process has read by system calls so far."""
    return int(dict(line.split(": ") for line in COUNTERS.read_text().splitlines())["rchar"])


@pytest.fixture(scope="module")
def huge_log(tmp_path_factory) -> Path:
    from sparse_log import write_sparse_log

    with SAMPLE.open("rb") as file:
        messages = list(islice(make_reader(file).iter_messages(topics=["/map"]), 40))
    path = tmp_path_factory.mktemp("sparse") / "huge.mcap"
    maps = [message.data for _, _, message in messages for _ in range(8)]
    write_sparse_log(path, 10_000_000_000, messages[0][0].data, maps)
    yield path
    path.unlink()


def test_another_reader_finds_every_map_in_it(huge_log: Path):
    assert huge_log.stat().st_size > 10_000_000_000
    if hasattr(huge_log.stat(), "st_blocks"):
        assert huge_log.stat().st_blocks * 512 < 100_000_000
    with huge_log.open("rb") as file:
        reader = make_reader(file)
        assert reader.get_summary().statistics.message_count > 100_000
        assert len(list(reader.iter_messages(topics=["/map"]))) == 320


@pytest.mark.skipif(not COUNTERS.exists(), reason="the system does not count the bytes that a process reads")
def test_info_reads_little_of_a_huge_log(huge_log: Path):
    """The index, the place of each map, the first and the last map."""
    describe_log(str(SAMPLE))
    before = bytes_read()
    facts = describe_log(str(huge_log))
    assert bytes_read() - before < MOST_READ
    (maps,) = facts.maps
    assert (maps.first.shape, maps.last.shape) == ((320, 512), (512, 704))
    assert next(topic.message_count for topic in facts.info.topics if topic.is_map) == 320
