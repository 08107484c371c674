"""Maps that are not of one run are told of and kept apart."""

import numpy as np
import pytest
from mcap.writer import Writer
from PIL import Image
from reader_logs import SHARED, START_NS, Map, McapLog, Update, message_type, serialized, typestore
from rosbags import rosbag1

import rose2_logs as rl
from rose2_logs.config.reading import ReadingParameters
from rose2_logs.errors import LogError, NoMapTopicError, ParameterError
from rose2_logs.io import open_log
from rose2_logs.io.parts import LOOKED_AT
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
        parts = reader.decided.get("parts")
        if parts is not None:
            assert [each["part"] for each in parts.pop("found")] == [*range(1, parts["count"] + 1)]
        return free, parts, found.kinds


GROWING = [50, 80, 110, 140, 170]


def test_two_publishers_are_kept_apart_and_the_one_that_grows_is_read(tmp_path):
    pairs = [(Map(seen(columns)), Map(seen(140, 150))) for columns in GROWING]
    path = log_of(tmp_path / "run.mcap", [each for pair in pairs for each in pair])
    free, part, kinds = read(path)
    assert free == [columns - 5 for columns in GROWING]
    assert part == {"analyzed": [1], "count": 2}
    (told,) = kinds["parts"].first
    assert "as of several publishers" in told["message"]
    assert "part=2 takes another" in told["message"]
    assert read(path, part=2) == ([135], {"analyzed": [2], "count": 2}, {})
    with pytest.raises(LogError, match="has no part 3; it has 2"):
        read(path, part=3)
    with pytest.raises(StrictError), collect_warnings(strict=True), open_log(path) as reader:
        reader.first()


def test_a_map_that_is_begun_anew_is_a_part_of_its_own(tmp_path):
    first, second = GROWING, GROWING[:4]
    path = log_of(tmp_path / "run.mcap", [seen(columns) for columns in (*first, *second)])
    free, part, kinds = read(path)
    assert free == [columns - 5 for columns in (*first, *second)]
    assert part == {"analyzed": [1, 2], "count": 2}
    (told,) = kinds["parts"].first
    assert "the map is begun anew" in told["message"]
    assert "each has its own coverage and tracks; part=1 takes one alone" in told["message"]
    for number, columns in ((1, first), (2, second)):
        assert read(path, part=number)[0] == [each - 5 for each in columns]


def test_parts_without_a_map_in_the_time_range_are_left_out(tmp_path):
    path = log_of(tmp_path / "run.mcap", [seen(columns) for columns in (*GROWING, *GROWING)])
    for selected, numbers in (
        ({}, [1, 2]),
        ({"start_s": 4.0, "end_s": 5.0}, [1, 2]),
        ({"end_s": 3.0}, [1]),
        ({"start_s": 6.0}, [2]),
        ({"max_snapshots": 2}, [1, 2]),
    ):
        with (
            collect_warnings() as warnings,
            open_log(path, selection=rl.Selection(**selected)) as reader,
        ):
            lasts = reader.lasts()
            assert list(lasts) == numbers
            assert lasts[numbers[-1]].log_time_ns == reader.last().log_time_ns
            assert {reader.part_at(each.log_time_ns) for each in reader.snapshots()} <= set(numbers)
            assert reader.decided["parts"]["analyzed"] == numbers
            assert ("parts" in warnings.kinds) == (len(numbers) > 1)


def test_parts_in_the_time_range_are_told_with_their_numbers(tmp_path):
    path = log_of(tmp_path / "run.mcap", [seen(columns) for columns in GROWING * 3])
    with collect_warnings() as warnings, open_log(path, selection=rl.Selection(start_s=6.0)) as reader:
        assert list(reader.lasts()) == [2, 3]
    (told,) = warnings.kinds["parts"].first
    assert "there are 3 parts, 2 of them in the time range: 2 of 5 maps (33 m2" in told["message"]
    assert told["message"].endswith("part=2 takes one alone")


def test_of_many_parts_a_line_names_the_first_and_the_summary_all(tmp_path):
    path = log_of(tmp_path / "run.mcap", [seen(columns) for columns in (60, 110, 170) * 16])
    with collect_warnings() as warnings, open_log(path) as reader:
        assert len(reader.lasts()) == 16
    (told,) = warnings.kinds["parts"].first
    assert "there are 16 parts: 1 of 3 maps" in told["message"]
    assert "4 of 3 maps (33 m2 free at its end) and 12 more; each has" in told["message"]
    assert len(told["message"]) < 400 + len(str(path))
    assert reader.decided["parts"]["found"] == [
        {"part": number, "maps": 3, "free_m2": 33.0} for number in range(1, 17)
    ]


def test_of_publishers_in_turn_only_those_in_the_time_range_are_chosen_from(tmp_path):
    """The one that tells most ends before the range begins."""
    pairs = [each for columns in GROWING for each in (Map(seen(columns)), Map(seen(140, 150)))]
    more = [Map(seen(140 + k, 150)) for k in range(2)]
    path = log_of(tmp_path / "run.mcap", [*pairs, *more])
    assert read(path)[1] == {"count": 2, "analyzed": [1]}
    free, parts, kinds = read(path, selection=rl.Selection(start_s=9.0))
    assert (free, parts, kinds) == ([135, 136], {"count": 2, "analyzed": [2]}, {})


def test_the_place_where_a_map_is_begun_anew_is_found_in_a_long_log(tmp_path):
    columns = [*range(30, 190), *range(20, 150)]
    path = log_of(tmp_path / "run.mcap", [seen(each) for each in columns])
    assert read(path, part=1)[0] == [each - 5 for each in columns[:160]]
    assert read(path, part=2)[0] == [each - 5 for each in columns[160:]]


def bag_of(path, maps, nodes):
    """A ROS 1 bag whose maps come from nodes that it names."""
    writer = rosbag1.Writer(path)
    with writer:
        name = message_type(maps[0])
        connections = {
            node: writer.add_connection("/map", name, typestore=typestore(1), callerid=node)
            for node in dict.fromkeys(nodes)
        }
        for k, (each, node) in enumerate(zip(maps, nodes, strict=True)):
            writer.write(connections[node], START_NS + k * 10**9, serialized(each, 1))
    return path


def mcap_of(path, maps, channels):
    """An MCAP with several channels of one topic."""
    definition = typestore(2).generate_msgdef("nav_msgs/msg/OccupancyGrid", ros_version=2)[0].encode()
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2")
        schema = writer.register_schema("nav_msgs/msg/OccupancyGrid", "ros2msg", definition)
        ids = {name: writer.register_channel("/map", "cdr", schema) for name in dict.fromkeys(channels)}
        for k, (each, name) in enumerate(zip(maps, channels, strict=True)):
            writer.add_message(ids[name], START_NS + k * 10**9, serialized(each, 2), START_NS + k * 10**9)
        writer.finish()
    return path


@pytest.mark.parametrize("write", [bag_of, mcap_of])
def test_publishers_are_told_apart_by_their_connections_also_on_one_grid(write, tmp_path):
    pairs = [(Map(seen(columns)), Map(seen(140))) for columns in GROWING]
    maps, nodes = [each for pair in pairs for each in pair], ["/slam", "/map_server"] * len(pairs)
    path = write(tmp_path / ("run.bag" if write is bag_of else "run.mcap"), maps, nodes)
    free, part, kinds = read(path)
    assert free == [columns - 5 for columns in GROWING]
    assert part == {"analyzed": [1], "count": 2}
    named = (
        "/slam, /map_server publish in turn" if write is bag_of else "channel 1, channel 2 publish in turn"
    )
    assert named in kinds["parts"].first[0]["message"]
    assert read(path, part=2)[0] == [135]


@pytest.mark.parametrize("nodes", [["/slam"] * 20, ["/slam"] * 5 + ["/slam_again"] * 15, None])
def test_a_map_that_is_begun_anew_on_grids_that_repeat_is_of_one_publisher(nodes, tmp_path):
    left = [
        np.pad(seen(columns, 180), ((0, 0), (20 * (k % 2), 20 * (1 - k % 2))), constant_values=-1)
        for k in range(4)
        for columns in GROWING
    ]
    maps = [Map(cells, origin=(-1.0 - 5 * (k // 5 % 2), 2.0)) for k, cells in enumerate(left)]
    path = tmp_path / "run.bag"
    path = log_of(tmp_path / "run.mcap", maps) if nodes is None else bag_of(path, maps, nodes)
    free, part, kinds = read(path)
    assert part == {"analyzed": [1, 2, 3, 4], "count": 4}
    assert len(free) == 20
    assert "the map is begun anew" in kinds["parts"].first[0]["message"]


def building(rows, columns):
    """Walls at some rows and columns, and floor between them."""
    cells = np.full((100, 200), -1, np.int8)
    cells[rows[0] : rows[-1], columns[0] : columns[-1]] = 0
    cells[rows[0] : rows[-1], columns] = cells[np.array(rows)[:, None], columns[0] : columns[-1]] = 100
    return cells


HOUSE = building([5, 25, 40, 90], [5, 30, 60, 110, 140, 170])
OTHER = building([8, 17, 60, 70, 97], [20, 43, 55, 85, 101, 155, 194])


def test_patches_are_of_the_part_of_the_map_before_them(tmp_path):
    log = McapLog(tmp_path / "run.mcap")
    for k, columns in enumerate((GROWING[0], *GROWING[1:], GROWING[0], *GROWING[1:])):
        time_ns = START_NS + k * 10**9
        if k in (0, 4, 5):
            log.add("/map", time_ns, Map(seen(columns)))
        else:
            log.add("/map_updates", time_ns, Update(0, 0, seen(columns)))
    path = log.close()
    assert read(path)[:2] == ([columns - 5 for columns in GROWING * 2], {"analyzed": [1, 2], "count": 2})
    assert read(path, part=2)[0] == [columns - 5 for columns in GROWING]


@pytest.mark.parametrize("far_m", [0.0, 50.0])
def test_another_building_of_the_same_size_is_a_part_of_its_own(far_m, tmp_path):
    growing = [np.where(np.arange(200) < columns, HOUSE, -1) for columns in GROWING]
    other = Map(OTHER, origin=(far_m - 1, 2.0))
    path = log_of(tmp_path / "run.mcap", [*growing, other, other])
    assert read(path)[1] == {"analyzed": [1, 2], "count": 2}
    assert len(read(path, part=1)[0]) == 5
    # One bad map between others is none.
    assert read(log_of(tmp_path / "bad.mcap", [*growing, other, HOUSE]))[1] is None


@pytest.mark.parametrize("count", [5, 70])
def test_publishers_with_one_grid_are_told_apart_by_their_buildings(count, tmp_path):
    """As two robots have whose mapping nodes are set up alike, also where the log names no publisher."""
    growing = [GROWING[min(5 * k // count, 4)] for k in range(count)]
    pairs = [(np.where(np.arange(200) < columns, HOUSE, -1), OTHER) for columns in growing]
    path = log_of(tmp_path / "run.mcap", [each for pair in pairs for each in pair])
    free, part, kinds = read(path)
    assert part == {"analyzed": [1], "count": 2}
    assert "maps of several buildings come in turn" in kinds["parts"].first[0]["message"]
    assert len(free) == len(GROWING)
    assert free == sorted(free)
    assert len(read(path, part=2)[0]) == 1


@pytest.mark.parametrize("grows", [True, False])
def test_publishers_with_much_the_same_building_are_told(grows, tmp_path):
    """As a map server beside a SLAM where walls were moved: 85 % of those of both are the same."""
    changed = building([5, 25, 40, 90], [5, 30, 72, 123, 154, 170])
    grown = [np.where(np.arange(200) < (columns if grows else 200), HOUSE, -1) for columns in GROWING]
    _, parts, kinds = read(log_of(tmp_path / "run.mcap", [each for one in grown for each in (one, changed)]))
    assert parts is None
    (told,) = kinds["in_turn"].first
    assert "of its first 10 maps show the walls of the map before the last" in told["message"]
    # One map of another building in between, now and then, is none of a publisher.
    maps = [*grown, changed, *[HOUSE] * 10, changed, *[HOUSE] * 10]
    assert "in_turn" not in read(log_of(tmp_path / "few.mcap", maps))[2]


def test_buildings_that_come_in_turn_at_the_beginning_only_are_of_one_run(tmp_path):
    """A window that goes back and forth between two places, and on to many others later in a long log."""

    def window(place):
        cells = np.full((100, 800), -1, np.int8)
        columns = slice(100 * place + 5, 100 * place + 95)
        cells[5:95, columns] = 100
        cells[7:93, columns.start + 2 : columns.stop - 2] = 0
        return cells

    places = [0, 1, 0, 1, 0, *[1] * LOOKED_AT, *range(2, 8)]
    _, parts, kinds = read(log_of(tmp_path / "run.mcap", [window(place) for place in places]))
    assert "the map is begun anew" in kinds["parts"].first[0]["message"]
    assert parts["analyzed"] == list(range(1, parts["count"] + 1))


def test_bad_maps_between_others_are_of_no_publisher(tmp_path):
    """Each is another one, and none is found again."""
    growing = [np.where(np.arange(200) < columns, HOUSE, -1) for columns in GROWING]
    bad = [OTHER, seen(190), building([2, 50, 98], [2, 75, 198])]
    maps = [*growing, *(each for one in bad for each in (one, HOUSE))]
    assert read(log_of(tmp_path / "run.mcap", maps))[1] is None


def test_an_origin_that_is_rounded_now_and_then_is_of_one_publisher(tmp_path):
    maps = [Map(seen(each), origin=(-1.0 + 1e-3 * (k % 2), 2.0)) for k, each in enumerate(GROWING)]
    assert read(log_of(tmp_path / "run.mcap", maps))[1] is None


def test_a_map_that_is_moved_as_a_whole_stays_of_one_part(tmp_path):
    growing = [np.where(np.arange(200) < columns, HOUSE, -1) for columns in GROWING]
    moved = [Map(HOUSE, origin=(0.5, 2.5)), Map(HOUSE, origin=(0.5, 2.5), stamp_ns=START_NS + 1)]
    assert read(log_of(tmp_path / "run.mcap", [*growing, *moved]))[1] is None


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
@pytest.mark.parametrize(
    ("name", "analyzed"), [("two_publishers", [1]), ("reset_moved", [1, 2]), ("gazebo_reset", [1, 2])]
)
def test_parts_of_logs_as_users_have_them(name, analyzed):
    with collect_warnings() as found, open_log(SHARED / "faults" / f"{name}.mcap") as reader:
        free = [int((each.cells == 0).sum()) for each in reader.snapshots()]
    assert free[-6:] == [4862, 13862, 22448, 31130, 40130, 44896]
    assert [reader.decided["parts"][key] for key in ("analyzed", "count")] == [analyzed, 2]
    assert found.kinds["parts"].count == 1


def save(folder, name, cells):
    pixels = np.flipud(np.select([cells == -1, cells == 0], [205, 254], 0)).astype(np.uint8)
    Image.fromarray(pixels).save(folder / f"{name}.pgm")
    text = f"image: {name}.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\n"
    (folder / f"{name}.yaml").write_text(text + "occupied_thresh: 0.65\nfree_thresh: 0.196\n")


def test_saved_maps_that_grow_from_each_other_are_one_run(tmp_path):
    for k, columns in enumerate(GROWING):
        save(tmp_path, f"map{k}", seen(columns))
    save(tmp_path, "map2", np.full((100, 200), -1, np.int8))
    free, part, kinds = read(tmp_path)
    assert (len(free), part, kinds) == (5, None, {})


@pytest.mark.parametrize("names", [("floor1", "floor2"), ("2nd floor", "3rd floor"), ("lab", "office")])
def test_saved_maps_of_other_floors_and_masks_are_not_read_as_one_run(names, tmp_path):
    upper = seen(170) if "floor" in names[0] else np.pad(seen(170).T, ((0, 0), (0, 100)))[:100]
    save(tmp_path, names[0], seen(170))
    save(tmp_path, names[1], upper)
    save(tmp_path, "keepout_mask", np.where(seen(170) == 0, 100, 0).astype(np.int8))
    free, part, kinds = read(tmp_path)
    assert len(free) == 1
    assert part["count"] == 2
    assert set(kinds) == {"masks", "parts"}
    assert "keepout_mask.yaml left out" in kinds["masks"].first[0]["message"]


def test_the_choice_among_topics_is_told_unless_one_was_named(tmp_path):
    log = McapLog(tmp_path / "run.mcap")
    for k, topic in enumerate(("/one/map", "/map", "/two/map")):
        log.add(topic, START_NS + k, Map(seen(100)))
    path = log.close()
    (told,) = read(path)[2]["topic"].first
    assert told["message"].endswith(
        "/map is read; /one/map, /two/map hold maps, too; topic='/one/map' chooses another"
    )
    assert not read(path, topic="/map")[2]


def test_a_channel_without_a_schema_is_named_and_read_by_the_type_that_is_given(tmp_path):
    log = McapLog(tmp_path / "run.mcap")
    log.raw("/map", START_NS, ("", "", b""), "cdr", serialized(Map(seen(100)), 2))
    path = log.close()
    with pytest.raises(NoMapTopicError, match=r"/map has no schema .*message_type='nav_msgs/OccupancyGrid'"):
        open_log(path)
    limits = ReadingParameters(type_without_schema="nav_msgs/OccupancyGrid")
    assert read(path, limits=limits)[0] == [95]
    with rl.open_log(path, message_type="nav_msgs/OccupancyGrid") as reader:
        assert len(list(reader.snapshots())) == 1
    with pytest.raises(ParameterError, match="message_type='nav_msgs/Odometry'"):
        rl.open_log(path, message_type="nav_msgs/Odometry")


def test_the_part_is_chosen_in_python_as_on_the_command_line(tmp_path):
    path = log_of(tmp_path / "run.mcap", [seen(columns) for columns in (*GROWING, *GROWING[:4])])
    with rl.open_log(path, part=2) as reader:
        assert len(list(reader.snapshots())) == 4
    with pytest.raises(ParameterError, match="part=0: it must be a whole number"):
        rl.open_log(path, part=0)
