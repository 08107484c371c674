"""A drawn plan shows each room where it is, in the color of its track, as SVG and as pixels alike."""

from __future__ import annotations

import base64
import dataclasses
import io
import xml.etree.ElementTree as ET
from itertools import pairwise

import numpy as np
import pytest
import shapely
from drawn_plans import LEFT, RIGHT, two_rooms_plan
from PIL import Image

from rose2_logs.drawing.drawing import Drawing
from rose2_logs.drawing.fonts import text_width
from rose2_logs.drawing.map_painter import (
    FREE_GRAY,
    HOLE_MIN,
    OCCUPIED_GRAY,
    UNKNOWN_GRAY,
    UNSURE_COLOR,
    simpler,
    tinted_cells,
)
from rose2_logs.drawing.palette import track_color
from rose2_logs.drawing.pixels import as_pixels
from rose2_logs.drawing.plan import (
    FIGURE,
    MARGIN_M,
    PANEL,
    SEEN_OPACITY,
    WALL_COLOR,
    draw_plan,
    draw_segmentation,
)
from rose2_logs.drawing.shapes import Area, Lines, Picture, Text
from rose2_logs.drawing.svg import as_svg
from rose2_logs.model.borders import UNSURE_BORDER_BELOW, Border
from rose2_logs.model.room_plan import PlanRoom, RoomPlan
from rose2_logs.model.rooms import Doorway

SVG = "{http://www.w3.org/2000/svg}"
XLINK = "{http://www.w3.org/1999/xlink}"
INKSCAPE = "{http://www.inkscape.org/namespaces/inkscape}"


def seen_color(number: int) -> np.ndarray:
    return np.round((1 - SEEN_OPACITY) * FREE_GRAY + SEEN_OPACITY * np.array(track_color(number)))


@pytest.mark.parametrize("yaw_rad", [0.0, 0.6])
def test_pixels_show_rooms_where_they_are(yaw_rad: float):
    """Also on a turned grid; x goes right and y up; what was not seen is pale, what is unknown is gray."""
    plan = two_rooms_plan(yaw_rad)
    drawing = draw_plan(plan, dataclasses.replace(PANEL, font=0.0, hatch_gap=1e9))
    image = as_pixels(drawing, 720)
    x0, _, x1, y1 = plan.bounds_m
    metres_per_px = (x1 - x0 + 2 * MARGIN_M) / 720

    def at(grid_xy_m):
        x, y = plan.map.geometry.grid_to_world(np.array(grid_xy_m))
        column, row = (x - x0 + MARGIN_M) / metres_per_px, (y1 + MARGIN_M - y) / metres_per_px
        return image[int(row), int(column)].astype(int)

    assert np.abs(at((2.2, 3.5)) - seen_color(LEFT)).max() <= 2
    assert np.abs(at((6.2, 1.5)) - seen_color(RIGHT)).max() <= 2
    pale = at((8.3, 2.5))
    assert np.abs(pale - np.array([UNKNOWN_GRAY] * 3)).max() > 5
    assert pale.mean() > seen_color(RIGHT).mean()
    assert at((5.0, 2.5))[0] > 180 > at((5.0, 2.5))[1] + 60  # the red doorway


def test_svg_is_xml_with_the_same_picture_and_shapes():
    """The picture within holds the gray map, paths are rooms, texts their names; markup is escaped."""
    plan = two_rooms_plan()
    text = as_svg(draw_plan(plan))
    root = ET.fromstring(text)
    assert root.get("aria-label") == plan.title == root.findtext(f"{SVG}title")
    (image,) = root.iter(f"{SVG}image")
    pixels = np.asarray(Image.open(io.BytesIO(base64.b64decode(image.get(f"{XLINK}href").split(",")[1]))))
    assert pixels.shape == (32, 62, 3)
    assert (pixels[10, 10] == FREE_GRAY).all()
    texts = [element.text for element in root.iter(f"{SVG}text")]
    assert {"Room 3", "Room 120", "12 m²", "predicted, unseen", "doorway"} <= set(texts)
    told = [element.text for element in root.iter(f"{SVG}title")]
    assert "Room 3: 12.0 m² seen of 12.0 m², 75% of its outline supported by walls" in told
    assert as_svg(draw_plan(two_rooms_plan())) == text


def test_drawing_programs_find_each_room_and_each_kind_of_thing():
    """A room is one path with an id and a title, in a layer of Inkscape; within a page there are no ids."""
    plan = two_rooms_plan()
    root = ET.fromstring(as_svg(draw_plan(plan)))
    layers = {each.get(f"{INKSCAPE}label"): each for each in root.iter(f"{SVG}g")}
    assert list(layers) == ["map", "unseen", "rooms", "outlines", "doorways", "names", "legend"]
    assert all(each.get(f"{INKSCAPE}groupmode") == "layer" for each in layers.values())
    rooms = {each.get("id"): each for each in layers["rooms"]}
    assert list(rooms) == ["room-3", "room-120"]
    assert rooms["room-3"].findtext(f"{SVG}title").startswith("Room 3: ")
    assert rooms["room-3"].get("fill") != rooms["room-120"].get("fill")
    assert {each.get("id") for each in layers["unseen"]} == {"room-120-unseen", "room-120-hatching"}
    identities = [each.get("id") for each in root.iter() if each.get("id")]
    assert len(set(identities)) == len(identities)
    inline = ET.fromstring(as_svg(draw_plan(plan), is_inline=True))
    assert not any(each.get("id") for each in inline.iter())


def test_names_are_written_where_they_have_room():
    """Along a corridor too; where a given name is too long, it is written smaller, then the number."""

    def written(room: PlanRoom) -> dict[str, float]:
        plan = RoomPlan("t", "map", (room,), ())
        bounds = (0.0, 0.0, 20.0, 20.0)
        texts = [each for each in draw_plan(plan, FIGURE, bounds).shapes if isinstance(each, Text)]
        return {each.text: each.size for each in texts if each.y < 780}

    corridor = PlanRoom(7, shapely.box(1, 9, 19, 10), 18.0, None, (), given_name="A long corridor")
    assert written(corridor)["A long corridor"] == FIGURE.font
    box = PlanRoom(7, shapely.box(5, 5, 7.1, 8), 6.3, None, (), given_name="Registry of all")
    assert written(box)["Registry of all"] < FIGURE.font
    assert "7" in written(dataclasses.replace(box, given_name="Registry of all the deeds"))


def test_unsure_rooms_are_marked_and_the_legend_says_so():
    """A sign behind the number of a room with little wall support, also in small pictures."""
    plan = two_rooms_plan()
    unsure, sure = (
        dataclasses.replace(
            plan, rooms=tuple(dataclasses.replace(room, wall_support=share) for room in plan.rooms)
        )
        for share in (0.69, 0.7)
    )

    def texts(plan, style):
        return [each.text for each in draw_plan(plan, style).shapes if isinstance(each, Text)]

    assert {f"{LEFT}?", f"{RIGHT}?"} <= set(texts(unsure, PANEL))
    assert {f"Room {LEFT}?", "unsure, little wall around"} <= set(texts(unsure, FIGURE))
    assert not any("?" in text or "unsure" in text for text in texts(sure, PANEL) + texts(sure, FIGURE))


def test_an_unsure_border_is_marked_at_its_doorway():
    """From the named strength on it is an ordinary doorway; without one it has no place to be marked."""
    plan = two_rooms_plan()

    def with_border(strength: float, rooms: tuple[int, int] = (LEFT, RIGHT)) -> Drawing:
        return draw_plan(dataclasses.replace(plan, borders=(Border(rooms, "door", 1.0, strength),)), FIGURE)

    def marked(drawing: Drawing) -> int:
        return sum(isinstance(each, Lines) and each.color == UNSURE_COLOR for each in drawing.shapes)

    below, above = UNSURE_BORDER_BELOW - 0.01, UNSURE_BORDER_BELOW
    unsure, sure, elsewhere = with_border(below), with_border(above), with_border(below, (LEFT, LEFT + 1))
    assert marked(unsure) == 2  # the line and that of the legend
    assert marked(sure) == marked(elsewhere) == 0
    words = {each.text for each in unsure.shapes if isinstance(each, Text)}
    assert "unsure border" in words


def strip_of(drawing: Drawing) -> float:
    """Where the strip with the legend begins: its paper covers what lies below."""
    areas = [each for each in drawing.shapes if isinstance(each, Area) and each.opacity == 1]
    (paper,) = (each for each in areas if each.fill == drawing.paper)
    return float(paper.shape.bounds[1])


@pytest.mark.parametrize("height_m", [4.0, 400.0])
def test_the_legend_fits_into_the_page(height_m: float):
    """Of a wide plan and of one that is narrow on its page; signs do not lie upon each other."""
    shape = shapely.box(0, 0, 20, height_m)
    rooms = (PlanRoom(1, shape, 4.0, (1.0, 1.0), (), 0.1),)
    doors = (Doorway((1, 1), np.array([[1.0, 0.0], [2.0, 0.0]])),)
    plan = RoomPlan("t", "map", rooms, doors, None, two_rooms_plan().map)
    drawing = draw_plan(plan, FIGURE, shape.bounds)
    strip = strip_of(drawing)
    found = [each for each in drawing.shapes if isinstance(each, Text) and each.y > strip]
    words = sorted((each for each in found if each.anchor == "start"), key=lambda each: each.x)
    assert len({each.y for each in words}) == 1
    ends = [(each.x, each.x + text_width(each.text, each.size)) for each in words]
    assert words[-1].text == "unsure, little wall around"
    assert ends[-1][1] < drawing.width
    assert all(end < start for (_, end), (start, _) in pairwise(ends))


def test_a_ray_beyond_the_plan_does_not_reach_into_the_legend():
    """It leaves the rooms downwards and ends at the rim of the plan."""
    plan = two_rooms_plan()
    cells = plan.map.cells.copy()
    cells[:10, 20:22] = 100
    plan = dataclasses.replace(plan, map=dataclasses.replace(plan.map, cells=cells))
    drawing = draw_plan(plan, FIGURE)
    image = as_pixels(drawing, int(FIGURE.width))
    strip = image[int(strip_of(drawing)) + 2 : -1]
    assert (strip[:4] == 255).all()
    assert (strip[-4:] == 255).all()


def test_several_plans_share_a_part_of_the_world():
    """With the same bounds a room stands at the same place of the page."""
    plan = two_rooms_plan()
    bounds = (-10.0, -10.0, 20.0, 20.0)
    sizes = set()
    for shown in (plan, dataclasses.replace(plan, rooms=plan.rooms[:1], map=None)):
        drawing = draw_plan(shown, PANEL, bounds)
        sizes.add((drawing.width, drawing.height))
        outline = next(
            each
            for each in drawing.shapes
            if isinstance(each, Lines) and each.shape.geom_type == "MultiPolygon"
        )
        scale = PANEL.width / 31
        corner = shapely.get_coordinates(outline.shape).min(0)
        assert corner == pytest.approx([(-1 + 10.5) * scale, (20.5 - 5) * scale], abs=0.5)
    assert len(sizes) == 1


def test_an_empty_plan_is_a_page():
    plan = dataclasses.replace(two_rooms_plan(), rooms=(), doorways=(), map=None)
    assert as_pixels(draw_plan(plan), 100).shape[1] == 100
    ET.fromstring(as_svg(draw_plan(plan)))


def test_colors_of_rooms_may_be_given():
    """As where two layouts are compared, and partners have one color."""
    plan = two_rooms_plan()
    drawing = draw_plan(plan, PANEL, colors={LEFT: (200, 10, 10), RIGHT: (10, 10, 200)})
    filled = [each for each in drawing.shapes if isinstance(each, Area) and each.opacity == SEEN_OPACITY]
    assert [each.fill for each in filled] == [(200, 10, 10), (10, 10, 200)]


def test_rooms_without_cells_are_filled_whole():
    """Where no cell is told to be a room's its shape is filled, but for what was not seen."""
    plan = two_rooms_plan()
    plan = dataclasses.replace(plan, map=dataclasses.replace(plan.map, labels=np.zeros_like(plan.map.labels)))
    drawing = draw_plan(plan, dataclasses.replace(PANEL, detail=0.0))
    scale = PANEL.width / (plan.bounds_m[2] - plan.bounds_m[0] + 2 * MARGIN_M)
    areas_m2 = {
        each.fill: each.shape.area / scale**2
        for each in drawing.shapes
        if isinstance(each, Area) and each.opacity == 0.5
    }
    assert areas_m2[track_color(LEFT)] == pytest.approx(12.0, abs=0.1)
    assert areas_m2[track_color(RIGHT)] == pytest.approx(6.0, abs=0.5)


def test_walls_are_drawn_where_they_are_wanted():
    plan = two_rooms_plan()
    for has_walls in (False, True):
        drawing = draw_plan(plan, dataclasses.replace(FIGURE, has_walls=has_walls))
        assert (WALL_COLOR in [each.color for each in drawing.shapes if isinstance(each, Lines)]) == has_walls
        texts = [each.text for each in drawing.shapes if isinstance(each, Text)]
        assert ("wall segment" in texts) == has_walls


def test_a_segmentation_is_drawn_beside_its_map():
    """The same part of the world twice, once without rooms."""
    drawing = draw_segmentation(two_rooms_plan())
    plain, below = (each for each in drawing.shapes if isinstance(each, Picture))
    assert np.array_equal(plain.pixels, below.pixels)
    apart = np.subtract(below.matrix[:, 2], plain.matrix[:, 2])
    assert np.abs(apart).max() > 200
    rooms = [each for each in drawing.shapes if isinstance(each, Area) and each.id in ("room-3", "room-120")]
    assert len(rooms) == 2
    x, y = np.min([shapely.bounds(each.shape)[:2] for each in rooms], axis=0)
    assert x >= below.matrix[0, 2]
    assert y >= below.matrix[1, 2] - plain.matrix[1, 2]
    with pytest.raises(ValueError, match="without a map"):
        draw_segmentation(dataclasses.replace(two_rooms_plan(), map=None))


def test_tint_fades_where_a_cell_is_occupied():
    """Walls stay dark within a room; a label without a color leaves a cell gray."""
    cells = np.array([[0, 100, -1, 0]], np.int8)
    pixels = tinted_cells(cells, np.array([[1, 1, 1, 2]]), {1: (255, 0, 0)}, 1.0)
    assert pixels[0].tolist() == [[255, 0, 0], [OCCUPIED_GRAY] * 3, [255, 0, 0], [FREE_GRAY] * 3]
    assert tinted_cells(cells)[0, 2].tolist() == [UNKNOWN_GRAY] * 3


def test_a_part_within_a_hole_too_small_to_be_seen_is_part_of_what_is_around_it():
    side = 0.9 * HOLE_MIN**0.5
    around = shapely.box(-10, -10, 10, 10) - shapely.box(0, 0, side, side)
    within = shapely.box(side / 4, side / 4, side / 2, side / 2)
    found = simpler(shapely.MultiPolygon([around, within]), 0.0)
    assert found.is_valid
    assert found.equals(shapely.box(-10, -10, 10, 10))
    assert simpler(shapely.MultiPolygon(), 1.0).is_empty
