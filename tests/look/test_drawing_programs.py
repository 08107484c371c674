"""Floor plans in the programs that they are exported for: Inkscape, QGIS and GDAL, LibreCAD."""

from __future__ import annotations

import json
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from commands import started, wait_for
from numpy.typing import NDArray
from PIL import Image
from programs import needed, screen, screenshot

from rose2_logs.drawing.palette import track_color
from rose2_logs.drawing.plan import MARGIN_M, SEEN_OPACITY
from rose2_logs.model.room_plan import RoomPlan
from rose2_logs.outputs.exports.layers import LAYERS
from rose2_logs.runs.run import Run
from rose2_logs.workflows.figure import export_plan

WIDTH_PX = 1000
DEBIAN_PYTHON = "/usr/bin/python3"
LIBRECAD_PX = (1500, 850)
LIBRECAD_SETTINGS = f"""
[Startup]
FirstLoad=0
ShowSplash=0
[Appearance]
Language=en
LanguageCmd=en
[Geometry]
WindowWidth={LIBRECAD_PX[0]}
WindowHeight={LIBRECAD_PX[1]}
WindowX=0
WindowY=0
"""
"""As of a user who has seen its first questions, and a window for a laptop's screen."""
OUTLINE_PX = 50
"""Pixels in the color of a room that are at least to be seen of its outline, which walls hide in part."""


@pytest.fixture(scope="session")
def plans(office: Path, tmp_path_factory) -> Path:
    """Exports of a run whose largest room has a name."""
    folder = tmp_path_factory.mktemp("plans")
    largest = max(Run(office)[-1].plan().rooms, key=lambda room: room.area_m2)
    names = folder / "names.csv"
    names.write_text(f"name,track\nLong corridor,{largest.number}\n")
    export_plan(office, ["svg", "dxf", "geojson", "qgis"], folder, names=names)
    return folder


@pytest.fixture(scope="session")
def plan(office: Path) -> RoomPlan:
    return Run(office)[-1].plan()


def seen_area_m2(picture: NDArray[np.int64], number: int, scale: float) -> float:
    """Area of what has the color of a room on white."""
    color = (1 - SEEN_OPACITY) * 255 + SEEN_OPACITY * np.array(track_color(number))
    return float((np.abs(picture - color).max(axis=2) <= 3).sum() / scale**2)


def test_inkscape_shows_the_map_and_the_rooms(plans: Path, plan: RoomPlan, pictures: Path):
    """Each room has its color over about the area that was seen of it; walls are dark."""
    (inkscape,) = needed("inkscape")
    (svg,) = plans.glob("*.svg")
    png = pictures / "inkscape_plan.png"
    command = [inkscape, svg, "--export-type=png", f"--export-filename={png}", f"--export-width={WIDTH_PX}"]
    subprocess.run(command, check=True, capture_output=True, timeout=300)
    picture = np.asarray(Image.open(png).convert("RGB")).astype(int)
    x0, _, x1, _ = plan.bounds_m
    scale = WIDTH_PX / (x1 - x0 + 2 * MARGIN_M)
    shown = {room.number: seen_area_m2(picture, room.number, scale) for room in plan.rooms}
    for room in plan.rooms:
        assert 0.5 * room.area_m2 < shown[room.number] < 1.1 * room.area_m2, room
    dark = (picture.max(axis=2) < 60).sum() / scale**2
    assert dark > 5.0  # the map's walls: without its picture only the names are dark


def test_inkscape_finds_rooms_by_their_ids(plans: Path, plan: RoomPlan):
    """Where they are, to be selected and given another color."""
    (inkscape,) = needed("inkscape")
    (svg,) = plans.glob("*.svg")
    told = subprocess.run(
        [inkscape, "--query-all", svg], check=True, capture_output=True, text=True, timeout=300
    )
    found = {line.split(",")[0] for line in told.stdout.splitlines()}
    assert {f"room-{room.number}" for room in plan.rooms} <= found
    assert {"map", "rooms", "outlines", "doorways", "names"} <= found


def test_gdal_reads_each_layer_in_meters(plans: Path, plan: RoomPlan):
    (ogrinfo,) = needed("ogrinfo")
    wanted = {"rooms": len(plan.rooms), "doorways": len(plan.doorways)}
    for name in LAYERS:
        (file,) = plans.glob(f"*.{name}.geojson")
        told = subprocess.run(
            [ogrinfo, "-ro", "-al", "-so", file], check=True, capture_output=True, text=True
        )
        assert f"Layer name: {name}" in told.stdout
        assert 'LENGTHUNIT["metre",1]' in told.stdout
        assert "degree" not in told.stdout
        if name in wanted:
            assert f"Feature Count: {wanted[name]}" in told.stdout


def test_qgis_draws_the_layers_with_their_styles(plans: Path, plan: RoomPlan, pictures: Path):
    """Rooms have their colors, and labels with their names; what was measured is meters."""
    try:
        subprocess.run([DEBIAN_PYTHON, "-c", "import qgis.core"], check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("needs QGIS, which .ci/look installs where this machine can have it")
    png = pictures / "qgis_layers.png"
    (rooms_file,) = plans.glob("*.rooms.geojson")
    stem = rooms_file.name.removesuffix(".rooms.geojson")
    script = Path(__file__).with_name("qgis_layers.py")
    told = subprocess.run(
        [DEBIAN_PYTHON, script, plans, stem, png, str(WIDTH_PX)],
        check=True,
        capture_output=True,
        text=True,
        timeout=300,
    )
    found = json.loads(told.stdout.splitlines()[-1])
    assert list(found["layers"]) == list(LAYERS)
    assert found["layers"]["rooms"]["labels"]
    assert all(layer["unit"] == "meters" for layer in found["layers"].values())
    assert found["layers"]["rooms"]["area"] == pytest.approx(
        sum(room.predicted_area_m2 for room in plan.rooms), rel=0.001
    )
    picture = np.asarray(Image.open(png).convert("RGB")).astype(int)
    for room in plan.rooms:
        shown = seen_area_m2(picture, room.number, found["px_per_m"])
        assert 0.4 * room.area_m2 < shown < 1.2 * room.predicted_area_m2, room


def test_librecad_opens_on_the_whole_plan(plans: Path, plan: RoomPlan, pictures: Path, tmp_path: Path):
    """It shows the outlines of all rooms in their colors, and walls in white."""
    (librecad,) = needed("librecad")
    (dxf,) = plans.glob("*.dxf")
    settings = tmp_path / ".config" / "LibreCAD" / "LibreCAD.conf"
    settings.parent.mkdir(parents=True)
    settings.write_text(LIBRECAD_SETTINGS)
    png = pictures / "librecad.png"

    def shown() -> bool:
        time.sleep(1)
        picture = np.asarray(Image.open(screenshot(environment, png)).convert("RGB")).astype(int)
        apart = (np.abs(picture - np.array(track_color(room.number))).max(axis=2) for room in plan.rooms)
        return all((each <= 2).sum() >= OUTLINE_PX for each in apart)

    with screen() as environment, started(librecad, str(dxf), env={**environment, "HOME": str(tmp_path)}):
        wait_for(shown)
        width, height = LIBRECAD_PX
        # Its sheet is black, with walls in white; what is around it is gray.
        sheet = np.asarray(Image.open(png).convert("RGB"))[height // 7 : height * 3 // 4, : width * 3 // 4]
        assert (sheet.min(axis=2) > 250).sum() > 500
