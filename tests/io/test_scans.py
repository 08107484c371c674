import math
from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from scan_logs import Echoes, Move, Scan, made, typestore

from rose2_logs.config.mapping import MappingParameters
from rose2_logs.errors import InvalidMapError
from rose2_logs.io.messages import CdrFields, Ros1Fields
from rose2_logs.io.scans import scan_of, transforms_of
from rose2_logs.mapping.log_odds import beams_of

BACKPACK = Path(__file__).parents[3] / "shared" / "bags" / "third_party" / "no_map_cartographer.bag"
BEARINGS = np.linspace(-1.5, 1.5, 7)
NAN, INF = math.nan, math.inf


def fields(message, ros, big_endian=False):
    store = typestore(ros)
    data = made(message, ros)
    if ros == 1:
        return Ros1Fields(memoryview(bytes(store.serialize_ros1(data, message.kind))))
    encoded = store.serialize_cdr(data, message.kind, little_endian=not big_endian)
    return CdrFields(memoryview(bytes(encoded)))


@pytest.mark.parametrize(("ros", "big_endian"), [(1, False), (2, False), (2, True)])
@pytest.mark.parametrize("kind", [Scan, Echoes])
def test_scans_are_read_as_they_were_written(ros, big_endian, kind):
    ranges = np.array([1.0, 2.5, INF, 4.0, 5.0, 29.5, 0.5])
    written = kind(12.25, ranges, BEARINGS, frame="/front/laser", increment_s=0.01)
    read = scan_of(fields(written, ros, big_endian), kind.kind)
    assert read.frame_id == "front/laser"
    assert read.bearings_rad == pytest.approx(BEARINGS, abs=1e-6)
    assert read.ranges_m.tolist() == ranges.tolist()
    assert (read.times_ns - read.stamp_ns) / 1e9 == pytest.approx(0.01 * np.arange(7))


def test_ranges_are_understood_by_their_bounds():
    ranges = np.array([NAN, -INF, -1.0, 0.0, 0.05, 30.0, 31.0])
    read = scan_of(fields(Scan(0.0, ranges, BEARINGS), 2), Scan.kind)
    assert np.isnan(read.ranges_m[:5]).all()
    assert np.isinf(read.ranges_m[5:]).all()
    boundless = Scan(
        0.0, np.array([NAN, 0.0, 0.05, 1.0, 31.0, 99.0, INF]), BEARINGS, range_min=0, range_max=0
    )
    read = scan_of(fields(boundless, 2), Scan.kind)
    assert read.ranges_m[2:6] == pytest.approx([0.05, 1.0, 31.0, 99.0])
    assert np.isnan(read.ranges_m[:2]).all()
    assert np.isinf(read.ranges_m[6])


def test_a_sweep_of_minutes_is_not_believed():
    read = scan_of(fields(Scan(0.0, np.ones(7), BEARINGS, increment_s=20.0), 2), Scan.kind)
    assert (read.times_ns == read.stamp_ns).all()


@pytest.mark.parametrize("kind", [Scan, Echoes])
def test_a_message_that_is_cut_off_is_refused(kind):
    data = bytes(typestore(2).serialize_cdr(made(kind(0.0, np.ones(7), BEARINGS), 2), kind.kind))
    for size in range(4, len(data) - 40, 7):
        with pytest.raises(InvalidMapError):
            scan_of(CdrFields(memoryview(data[:size])), kind.kind)


@pytest.mark.parametrize("kind", [Scan, Echoes])
def test_damaged_bytes_are_refused_or_give_beams_that_can_be_drawn(kind):
    """Where bytes are changed at random, the beams have finite ends at most as far as is trusted, or none."""
    random = np.random.default_rng(5)
    data = np.frombuffer(
        typestore(2).serialize_cdr(made(kind(0.0, np.ones(7), BEARINGS), 2), kind.kind), np.uint8
    )
    read = 0
    for _ in range(3000):
        changed = data.copy()
        changed[random.integers(4, len(data), 3)] = random.integers(0, 256, 3)
        try:
            scan = scan_of(CdrFields(memoryview(changed.tobytes())), kind.kind)
        except InvalidMapError:
            continue
        read += 1
        directions = np.stack([np.cos(scan.bearings_rad), np.sin(scan.bearings_rad)], 1)
        beams = beams_of(np.zeros(2), directions, scan.ranges_m, MappingParameters())
        assert (np.hypot(*beams.ends_m.T) <= 20.001).all()
        assert len(scan.times_ns) == len(scan.ranges_m)
    assert read > 500


def test_angles_that_are_no_numbers_are_refused():
    with pytest.raises(InvalidMapError, match="its angles"):
        scan_of(fields(Scan(0.0, np.ones(7), np.full(7, NAN)), 2), Scan.kind)


@pytest.mark.parametrize("ros", [1, 2])
def test_transforms_are_read_as_they_were_written(ros):
    move = Move(1.5, "/map", "/base_link", (1.0, 2.0, 3.0), (0.5, -0.5, 0.5, 0.5))
    (read,) = transforms_of(fields(move, ros))
    assert (read.parent, read.child) == ("map", "base_link")
    assert read.pose == (1.0, 2.0, 3.0, 0.5, -0.5, 0.5, 0.5)


@pytest.mark.skipif(not BACKPACK.exists(), reason="needs the logs in ../shared beside the project")
def test_echoes_of_a_real_log_are_those_that_another_reader_finds():
    with AnyReader([BACKPACK]) as reader:
        connections = [each for each in reader.connections if "MultiEcho" in each.msgtype]
        for count, (connection, _, raw) in enumerate(reader.messages(connections)):
            if count % 50:
                continue
            theirs = reader.deserialize(raw, connection.msgtype)
            ours = scan_of(Ros1Fields(memoryview(raw)), connection.msgtype)
            nearest = [each.echoes[0] if len(each.echoes) else INF for each in theirs.ranges]
            assert len(ours.ranges_m) == len(nearest) > 500
            kept = np.isfinite(ours.ranges_m)
            assert kept.mean() > 0.3
            assert (ours.ranges_m[kept] == np.array(nearest, float)[kept]).all()
