"""Saved maps are read as map_server reads them."""

import math

import numpy as np
import pytest
from PIL import Image

from rose2_logs.config.selection import Selection
from rose2_logs.errors import InvalidMapError, LogError, NoMapTopicError
from rose2_logs.io import inspect_log, open_log


def save(path, pixels, *, image=None, **described):
    """Write ``path``.yaml and its image; returns the yaml."""
    image = image or f"{path.name}.pgm"
    Image.fromarray(pixels).save(path.parent / image)
    described = {
        "image": image, "resolution": 0.05, "origin": "[-1.5, 2.0, 0.0]",
        "negate": 0, "occupied_thresh": 0.65, "free_thresh": 0.196,
    } | described  # fmt: skip
    yaml = path.with_suffix(".yaml")
    yaml.write_text("".join(f"{name}: {value}\n" for name, value in described.items() if value is not None))
    return yaml


def read(path, **options):
    with open_log(path, **options) as log:
        return list(log.snapshots())


PIXELS = np.array([[0, 254, 205], [254, 254, 205]], np.uint8)


@pytest.mark.parametrize("image", ["m.pgm", "m.png", "m.bmp"])
def test_a_saved_map_is_a_log_of_one_snapshot_with_the_bottom_row_first(image, tmp_path):
    yaml = save(tmp_path / "m", PIXELS, image=image)
    (snapshot,) = read(yaml)
    assert snapshot.cells.tolist() == [[0, 0, -1], [100, 0, -1]]
    assert snapshot.cells.flags.c_contiguous
    geometry = snapshot.geometry
    assert (geometry.origin_xy_m, geometry.yaw_rad, geometry.resolution_m) == ((-1.5, 2.0), 0.0, 0.05)
    assert (snapshot.index, snapshot.log_time_ns, snapshot.topic) == (0, 0, "/map")
    (from_image,) = read(tmp_path / image)
    np.testing.assert_array_equal(from_image.cells, snapshot.cells)
    info = inspect_log(yaml)
    assert info.topics[0].is_map
    assert info.size_bytes == yaml.stat().st_size + (tmp_path / image).stat().st_size


def test_the_yaw_of_the_origin_is_kept(tmp_path):
    (snapshot,) = read(save(tmp_path / "m", PIXELS, origin="[0, 0, -2.5]"))
    assert math.isclose(snapshot.geometry.yaw_rad, -2.5)


def test_trinary_compares_with_both_thresholds_without_equality(tmp_path):
    # Occupancy of a pixel p is (255 - p) / 255.
    pixels = np.array([[255, 204, 203, 103, 102, 101, 0]], np.uint8)
    (snapshot,) = read(save(tmp_path / "m", pixels, occupied_thresh=0.6, free_thresh=0.2))
    assert snapshot.cells.tolist() == [[0, -1, -1, -1, -1, 100, 100]]


def test_thresholds_left_out_are_those_of_map_server(tmp_path):
    pixels = np.array([[255, 206, 205, 90, 89, 0]], np.uint8)
    (snapshot,) = read(save(tmp_path / "m", pixels, occupied_thresh=None, free_thresh=None, negate=None))
    assert snapshot.cells.tolist() == [[0, 0, -1, -1, 100, 100]]


def test_negate_makes_white_occupied(tmp_path):
    (snapshot,) = read(save(tmp_path / "m", np.array([[0, 128, 255]], np.uint8), negate=1))
    assert snapshot.cells.tolist() == [[0, -1, 100]]


def test_scale_spreads_occupancy_between_the_thresholds(tmp_path):
    pixels = np.array([[255, 204, 153, 102, 51, 0]], np.uint8)  # 0, .2, .4, .6, .8, 1
    (snapshot,) = read(save(tmp_path / "m", pixels, mode="scale", occupied_thresh=0.9, free_thresh=0.1))
    assert snapshot.cells.tolist() == [[0, 12, 38, 62, 88, 100]]


@pytest.mark.parametrize("mode", ["scale", "trinary"])
def test_transparent_pixels_are_unknown(mode, tmp_path):
    pixels = np.zeros((1, 3, 4), np.uint8)
    pixels[0, :, :3] = [[0], [255], [0]]
    pixels[0, :, 3] = [255, 255, 0]
    (snapshot,) = read(save(tmp_path / "m", pixels, mode=mode, image="m.png"))
    assert snapshot.cells.tolist() == [[100, 0, -1]]


def test_raw_pixels_are_percent_and_the_rest_unknown(tmp_path):
    (snapshot,) = read(save(tmp_path / "m", np.array([[0, 1, 100, 101, 255]], np.uint8), mode="raw"))
    assert snapshot.cells.tolist() == [[0, 1, 100, -1, -1]]


def test_colors_count_by_their_mean_and_sixteen_bits_by_their_share(tmp_path):
    colors = np.array([[[255, 255, 255], [0, 0, 0], [255, 120, 0]]], np.uint8)
    assert read(save(tmp_path / "rgb", colors, image="rgb.png"))[0].cells.tolist() == [[0, 100, -1]]
    deep = np.array([[65535, 0, 33000]], np.uint16)
    Image.fromarray(deep).save(tmp_path / "deep.png")
    yaml = save(tmp_path / "other", PIXELS)
    yaml.write_text(yaml.read_text().replace("other.pgm", "deep.png"))
    assert read(yaml)[0].cells.tolist() == [[0, 100, -1]]


def test_unknown_cells_saved_with_too_high_a_free_thresh_stay_unknown(tmp_path, caplog):
    (snapshot,) = read(save(tmp_path / "m", PIXELS, free_thresh=0.25))
    assert snapshot.cells.tolist() == [[0, 0, -1], [100, 0, -1]]
    assert "free_thresh of 0.25" in caplog.text
    # An image with other values was not saved that way: its thresholds mean what they say.
    (snapshot,) = read(save(tmp_path / "m", np.where(PIXELS == 0, np.uint8(100), PIXELS), free_thresh=0.25))
    assert (snapshot.cells[:, 2] == 0).all()


@pytest.mark.parametrize(
    ("described", "match"),
    [
        ({"resolution": "wide"}, "resolution is 'wide'"),
        ({"resolution": 0}, "resolution"),
        ({"resolution": ".nan"}, "resolution"),
        ({"origin": "[1, 2]"}, "origin"),
        ({"origin": "[1, 2, .inf]"}, "origin"),
        ({"occupied_thresh": 0.1}, "thresh"),
        ({"free_thresh": -1}, "thresh"),
        ({"negate": "maybe"}, "negate"),
        ({"mode": "rgb"}, "mode"),
        ({"image": None}, "image"),
    ],
)
def test_a_description_that_cannot_be_used_is_an_error_that_names_the_file(described, match, tmp_path):
    yaml = save(tmp_path / "m", PIXELS)
    lines = {line.split(": ")[0]: line for line in yaml.read_text().splitlines()}
    for name, value in described.items():
        lines[name] = f"{name}: {value}" if value is not None else ""
    yaml.write_text("\n".join(lines.values()))
    with open_log(yaml) as log, pytest.raises(InvalidMapError, match=match) as caught:
        list(log.snapshots())
    assert "m.yaml" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_image_that_is_broken_is_an_error(tmp_path):
    yaml = save(tmp_path / "m", PIXELS)
    (tmp_path / "m.pgm").write_bytes(b"P5 100 100 255\n123")
    with open_log(yaml) as log, pytest.raises(InvalidMapError, match=r"m\.pgm"):
        list(log.snapshots())


def test_a_folder_a_pattern_or_a_list_of_maps_is_a_sequence_in_natural_order(tmp_path):
    for k in (10, 9, 1, 2):
        save(tmp_path / f"map{k}", np.full((1, k), 254, np.uint8))
    (tmp_path / "config.yaml").write_text("use_sim_time: true\n")
    for path in (tmp_path, str(tmp_path / "map*.yaml"), str(tmp_path / "map*.pgm")):
        snapshots = read(path)
        assert [each.geometry.shape[1] for each in snapshots] == [1, 2, 9, 10]
        assert [each.index for each in snapshots] == [0, 1, 2, 3]
        assert [each.log_time_ns for each in snapshots] == [0, 10**9, 2 * 10**9, 3 * 10**9]
    given = read([tmp_path / "map10.yaml", tmp_path / "map2.yaml"])
    assert [each.geometry.shape[1] for each in given] == [10, 2], "a list is taken as it stands"
    chosen = read(tmp_path, selection=Selection(max_snapshots=2))
    assert [each.geometry.shape[1] for each in chosen] == [1, 10]
    with open_log(tmp_path) as log:
        assert log.last().geometry.shape == (1, 10)


def test_a_topic_that_saved_maps_do_not_have_is_refused(tmp_path):
    with pytest.raises(NoMapTopicError):
        open_log(save(tmp_path / "m", PIXELS), topic="/costmap")


def test_an_image_alone_asks_for_its_description(tmp_path):
    Image.fromarray(PIXELS).save(tmp_path / "alone.png")
    with pytest.raises(LogError, match=r"alone\.yaml"):
        open_log(tmp_path / "alone.png")


@pytest.mark.parametrize("resolution", ["5e-2", "0.05", ".05", '"0.05"', "5.0E-02", "+0.05"])
def test_numbers_are_read_as_yaml_1_2_and_yaml_cpp_read_them(resolution, tmp_path):
    path = save(tmp_path / "m", PIXELS, resolution=resolution, origin="[-9.39e-05, 1e-05, 010]")
    geometry = read(path)[0].geometry
    assert geometry.resolution_m == 0.05
    assert geometry.origin_xy_m == (-9.39e-05, 1e-05)
    assert geometry.yaw_rad == pytest.approx(math.remainder(10, math.tau))


@pytest.mark.parametrize("resolution", ["0,05", "1:30", "0x10", "5e-2m", "yes", "1_0", "inf"])
def test_what_is_no_number_there_is_none_here(resolution, tmp_path):
    with (
        open_log(save(tmp_path / "m", PIXELS, resolution=resolution)) as log,
        pytest.raises(InvalidMapError, match="resolution is"),
    ):
        list(log.snapshots())


@pytest.mark.parametrize("negate", ["0", "false", "False", "no", '"0"'])
def test_negate_may_be_a_word(negate, tmp_path):
    assert read(save(tmp_path / "m", PIXELS, negate=negate))[0].cells.tolist() == [[0, 0, -1], [100, 0, -1]]


@pytest.mark.parametrize("yaw", [".nan", "nan", "-nan", ".NaN"])
def test_a_yaw_that_is_not_a_number_is_none_and_told(yaw, tmp_path, caplog):
    (snapshot,) = read(save(tmp_path / "m", PIXELS, origin=f"[1.0, 2.0, {yaw}]"))
    assert snapshot.geometry.yaw_rad == 0
    assert snapshot.geometry.origin_xy_m == (1.0, 2.0)
    assert "the yaw of its origin is not a number" in caplog.text


@pytest.mark.parametrize(
    "named",
    [
        "maps/m.pgm",
        "/home/robot/maps/m.pgm",
        "~/m.pgm",
        "file:///home/robot/m.pgm",
        "package://maps/m.pgm",
        r"C:\maps\m.pgm",
        "../m.pgm",
        "gone.pgm",
    ],
)
def test_an_image_that_lies_elsewhere_is_the_one_beside_the_description(named, tmp_path, caplog, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    path = save(tmp_path / "m", PIXELS)
    path.write_text(path.read_text().replace("image: m.pgm", f"image: '{named}'"))
    assert read(path)[0].cells.tolist() == [[0, 0, -1], [100, 0, -1]]
    assert "m.pgm next to m.yaml is read" in caplog.text


@pytest.mark.parametrize("named", ["~/maps/m.pgm", "file://{}/home/maps/m.pgm", "home/maps/m.pgm"])
def test_an_image_that_is_where_its_description_says_is_read_without_a_word(
    named, tmp_path, caplog, monkeypatch
):
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    path = save(tmp_path / "m", PIXELS)
    (tmp_path / "home/maps").mkdir(parents=True)
    (tmp_path / "m.pgm").rename(tmp_path / "home/maps/m.pgm")
    path.write_text(path.read_text().replace("image: m.pgm", f"image: {named.format(tmp_path)}"))
    assert len(read(path)) == 1
    assert not caplog.text


def test_an_image_that_is_nowhere_is_an_error_that_names_it(tmp_path):
    path = save(tmp_path / "m", PIXELS)
    (tmp_path / "m.pgm").unlink()
    with open_log(path) as log, pytest.raises(InvalidMapError, match=r"m\.pgm"):
        list(log.snapshots())
