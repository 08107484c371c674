"""Plans in the axes of matplotlib: the map where it lies, rooms in their colors, unseen parts hatched."""

from __future__ import annotations

import dataclasses
import sys

import numpy as np
import pytest
import shapely
from support.drawn_plans import LEFT, RIGHT, two_rooms_plan

from rose2_logs.drawing.palette import track_color
from rose2_logs.drawing.plot import HATCH, plot_plan
from rose2_logs.errors import MissingPackageError

matplotlib = pytest.importorskip("matplotlib")
matplotlib.use("Agg")


@pytest.fixture
def axes():
    """Return axes of their own, closed in the end."""
    from matplotlib import pyplot

    figure, made = pyplot.subplots()
    yield made
    pyplot.close(figure)


@pytest.mark.parametrize("yaw_rad", [0.0, 0.6])
def test_the_map_lies_in_the_world(axes, yaw_rad: float):
    """Also on a turned grid: the middle of a room has the room's color there."""
    plan = two_rooms_plan(yaw_rad)
    assert plot_plan(plan, axes) is axes
    (image,) = axes.get_images()
    pixels = np.asarray(image.get_array())
    below = plan.map.cropped()
    point = plan.map.geometry.grid_to_world(np.array([2.2, 3.5]))
    on_screen = axes.transData.transform(point)
    column, row = image.get_transform().inverted().transform(on_screen)
    assert pixels.shape[:2] == below.cells.shape
    color = pixels[int(row), int(column)].astype(int)
    assert np.abs(color - (0.45 * 255 + 0.55 * np.array(track_color(LEFT)))).max() <= 2


def test_axes_are_meters_of_the_frame(axes):
    plan = two_rooms_plan()
    plot_plan(plan, axes)
    assert axes.get_aspect() == 1
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x in map, m", "y in map, m")
    x0, y0, x1, y1 = plan.bounds_m
    assert (*axes.get_xlim(), *axes.get_ylim()) == pytest.approx((x0 - 0.5, x1 + 0.5, y0 - 0.5, y1 + 0.5))


def test_names_doorways_and_unseen_parts_are_drawn(axes):
    plan = two_rooms_plan()
    unsure = tuple(dataclasses.replace(room, wall_support=0.5) for room in plan.rooms)
    plot_plan(dataclasses.replace(plan, rooms=unsure), axes)
    assert [text.get_text() for text in axes.texts] == [f"{LEFT}?\n12 m²", f"{RIGHT}?\n6.0 m²"]
    (door,) = axes.get_lines()
    assert np.asarray(door.get_xydata()) == pytest.approx(plan.doorways[0].ends_m.reshape(2, 2))
    (hatched,) = (patch for patch in axes.patches if patch.get_hatch() == HATCH)
    x0, y0, x1, y1 = hatched.get_path().get_extents().extents
    assert (x0, y0, x1, y1) == pytest.approx((-2 + 7, 1 + 1, -2 + 9, 1 + 4), abs=0.25)


def test_a_plan_without_a_map_has_filled_shapes_whose_holes_stay_open(axes):
    ring = shapely.box(0, 0, 6, 6).difference(shapely.box(2, 2, 4, 4))
    plan = two_rooms_plan()
    rooms = (dataclasses.replace(plan.rooms[0], shape=ring),)
    plot_plan(dataclasses.replace(plan, rooms=rooms, map=None), axes)
    assert not axes.get_images()
    axes.texts[0].remove()
    axes.figure.canvas.draw()
    image = np.asarray(axes.figure.canvas.buffer_rgba())
    inside, hole = (
        image[len(image) - int(y), int(x), :3] for x, y in axes.transData.transform([(1, 1), (3, 3)])
    )
    assert inside.min() < 250
    assert hole.tolist() == [255, 255, 255]


def test_new_axes_are_made_where_none_are_given():
    from matplotlib import pyplot

    made = plot_plan(two_rooms_plan())
    assert made.figure is not None
    pyplot.close(made.figure)


def test_without_matplotlib_a_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)
    with pytest.raises(MissingPackageError, match=r"rose2-logs\[notebook\]") as caught:
        plot_plan(two_rooms_plan())
    assert "\n" not in str(caught.value)
