"""Draw the documentation's pictures: each stage of the method on a map of a sample log, and others.

    python tools/make_docs_pictures.py docs/images

The pictures are made by the tool's own stages, so they show what it does. ``overview.png`` and ``report.png``
are screenshots and not made here: of the viewer, see ``tools/screenshot_recording.py``, and of a report in a
browser.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TypeVar

import cv2
import numpy as np
import shapely
from numpy.typing import NDArray
from PIL import Image as PillowImage

from rose2_logs.config.parameters import Parameters
from rose2_logs.drawing.palette import track_color
from rose2_logs.drawing.pixels import as_pixels
from rose2_logs.drawing.plan import PANEL, draw_plan
from rose2_logs.io import open_log
from rose2_logs.model.analysis import SnapshotAnalysis
from rose2_logs.model.explored import ExploredPart
from rose2_logs.model.labels import known_window
from rose2_logs.model.occupancy import UNKNOWN, BoolArray, FloatArray, OccupancySnapshot
from rose2_logs.runs.run import Run
from rose2_logs.segmentation.pipeline import analyze
from rose2_logs.segmentation.regions.fitted import answering_network
from rose2_logs.segmentation.regions.stage import find_atoms, generous_floor_plan, generous_walls
from rose2_logs.segmentation.rose.spectrum import Spectrum, compute_spectrum
from rose2_logs.segmentation.rose.stage import find_structure
from rose2_logs.segmentation.walls.stage import WallCounter
from rose2_logs.segmentation.walls.strips import WallCells
from rose2_logs.workflows.analyze import RunOptions, analyze_log
from rose2_logs.workflows.compare import compare_runs

Image = NDArray[np.uint8]
Color = tuple[int, int, int]
Scalar = TypeVar("Scalar", bound=np.generic)

SAMPLES = Path(__file__).resolve().parents[1] / "sample_logs"
METHOD_LOG, TUTORIAL_LOG = SAMPLES / "wing.bag", SAMPLES / "office.mcap"
METHOD_SNAPSHOT = 24
"""A map in the midst of the run: some rooms are half seen, and some are split."""
HALF_WAY_S = 200.0
"""The second run of the comparison ends here: some rooms are not entered yet."""
TUTORIAL_COVERAGES = (0.35, 0.7, 1.0)
GROWTH_PANEL_PX = 700
SCALE = 2
"""Pixels along a cell."""
MARGIN_CELLS = 24
PALETTE_COLORS = 256
"""Colors of a stored picture: flat drawings lose nothing, and take a third of the bytes."""
SPECTRUM_SIDE_PX, SPECTRUM_REACH_PER_M = 700, 4.0
"""The spectrum is drawn up to this frequency, cycles per meter: waves of 25 cm."""
WALL, PAPER, GRAY, REMOVED, MARK = (
    (20, 20, 20),
    (255, 255, 255),
    (170, 170, 170),
    (235, 120, 110),
    (220, 30, 30),
)
ROOM_OPACITY = 0.6


class Painter:
    """Draws what was found in a map, cropped to its known part; row 0 at the top as in the world."""

    def __init__(self, snapshot: OccupancySnapshot) -> None:
        rows, columns = known_window(snapshot.cells != UNKNOWN)
        self._window = (
            slice(max(rows.start - MARGIN_CELLS, 0), rows.stop + MARGIN_CELLS),
            slice(max(columns.start - MARGIN_CELLS, 0), columns.stop + MARGIN_CELLS),
        )
        self._snapshot = snapshot
        self._geometry = snapshot.geometry.part(self._window)

    def map(self, faint: bool = False) -> Image:
        """Draw the map itself; faintly, as the ground of a drawing, its occupied cells alone."""
        cells = self._snapshot.cells[self._window]
        if faint:
            return self.cells(self._snapshot.cells > 50, (205, 205, 205), np.full((1, 1, 3), 255, np.uint8))
        gray = np.where(cells < 0, 205, 254 - cells * 2.54).astype(np.uint8)
        return self._scaled(np.repeat(gray[..., None], 3, axis=2))

    def cells(self, mask: BoolArray, color: Color, image: Image) -> Image:
        """Paint cells (H, W) of the canvas over a picture."""
        inside = self._scaled(mask[self._window])
        painted = np.broadcast_to(image, (*inside.shape, 3)).copy()
        painted[inside] = color
        return painted

    def values(self, values: NDArray[np.float32], colormap: int) -> Image:
        """Draw values in [0, 1] of the cells above 0 in a color map on white."""
        part = self._scaled(values[self._window])
        colored = cv2.applyColorMap((255 * part.clip(0, 1)).astype(np.uint8), colormap)[..., ::-1]
        return np.where((part > 0)[..., None], colored, np.uint8(255))

    def rooms(self, labels: NDArray[np.int32], image: Image) -> Image:
        """Fill the rooms of a label image (H, W) of the canvas with colors of their own."""
        part = self._scaled(labels[self._window])
        colors = _label_colors(int(labels.max(initial=0))).astype(float)
        blended = ROOM_OPACITY * colors[part] + (1 - ROOM_OPACITY) * image
        return np.where((part > 0)[..., None], blended, image).astype(np.uint8)

    def lines(
        self, image: Image, ends_m: FloatArray, colors: Sequence[Color], widths: Sequence[int]
    ) -> Image:
        """Draw segments (N, 4), each with a color and a width in pixels."""
        painted = image.copy()
        points = self._pixels(ends_m.reshape(-1, 2)).reshape(-1, 2, 2)
        for (start, end), color, width in zip(points.tolist(), colors, widths, strict=True):
            cv2.line(painted, start, end, color, width, cv2.LINE_AA)
        return painted

    def outlines(self, image: Image, shapes: Sequence[shapely.Geometry], color: Color) -> Image:
        """Draw the rings of shapes in the world."""
        painted = image.copy()
        rings = [
            self._pixels(shapely.get_coordinates(ring))
            for shape in shapes
            for ring in shapely.get_rings(shape)
        ]
        cv2.polylines(painted, rings, True, color, SCALE, cv2.LINE_AA)
        return painted

    def _pixels(self, points_m: FloatArray) -> NDArray[np.int32]:
        x, y = (self._geometry.world_to_grid(points_m) / self._geometry.resolution_m * SCALE).T
        return np.round(np.column_stack([x, self._geometry.shape[0] * SCALE - y])).astype(np.int32)

    def _scaled(self, values: NDArray[Scalar]) -> NDArray[Scalar]:
        return values[::-1].repeat(SCALE, axis=0).repeat(SCALE, axis=1)


def method_pictures(snapshot: OccupancySnapshot, parameters: Parameters) -> Iterator[tuple[str, Image]]:
    """Yield name and picture of each stage of the method on one map."""
    painter, analysis = Painter(snapshot), analyze(snapshot, parameters)
    structure, walls, plan = analysis.structure, analysis.walls, analysis.floor_plan
    if structure is None or walls is None or plan is None:
        raise RuntimeError("the method pictures show the stages of rose2")
    occupied = snapshot.cells > parameters.occupancy.occupied_min_percent
    faint = painter.map(faint=True)
    yield "method_1_map", painter.map()
    spectrum = compute_spectrum(occupied, snapshot.geometry.resolution_m, parameters.spectrum)
    yield "method_2_spectrum", _spectrum_picture(spectrum, structure.directions_rad)
    yield "method_3_score", painter.values(structure.score, cv2.COLORMAP_VIRIDIS)
    removed = painter.cells(occupied, REMOVED, np.full((1, 1, 3), 255, np.uint8))
    yield "method_4_clean_map", painter.cells(structure.clean, WALL, removed)
    of_cluster = _spread_colors(int(walls.segment_cluster.max(initial=-1)) + 2)
    segments = [of_cluster[cluster + 1] for cluster in walls.segment_cluster.tolist()]
    yield "method_5_segments", painter.lines(faint, walls.segments_m, segments, [SCALE] * len(segments))
    by_weight = [_mixed((205, 215, 240), (20, 60, 180), weight) for weight in walls.line_weight.tolist()]
    yield "method_6_lines", painter.lines(faint, walls.lines_m, by_weight, [SCALE] * len(by_weight))
    inside = [
        face for face, is_inside in zip(plan.faces, plan.face_inside.tolist(), strict=True) if is_inside
    ]
    counted = np.flatnonzero(
        plan.face_inside[plan.edge_faces].any(axis=1) & (plan.edge_faces >= 0).any(axis=1)
    )
    weights = plan.edge_weight[counted].tolist()
    edges = [_mixed((120, 200, 130), MARK, weight) for weight in weights]
    faces = painter.outlines(faint, inside, (225, 225, 225))
    yield "method_7_faces", painter.lines(faces, plan.edges_m[counted], edges, [SCALE + 1] * len(edges))
    atoms, answer = _atoms_and_answers(snapshot, parameters)
    yield "method_8_atoms", painter.rooms(atoms, faint)
    yield "method_9_answers", painter.values(np.where(atoms > 0, answer, 0), cv2.COLORMAP_MAGMA)
    yield "method_10_floor_plan", _floor_plan_picture(painter, analysis)


def _atoms_and_answers(
    snapshot: OccupancySnapshot, parameters: Parameters
) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Atoms of the floor, and how likely the network finds each cell to lie on a border, on the canvas."""
    part = ExploredPart.of(snapshot.cells, snapshot.geometry, parameters.occupancy)
    cell_m = part.resolution_m
    scored = find_structure(part.occupied, cell_m, parameters.spectrum)
    direction = float(scored.directions_rad[0])
    count_walls = WallCounter(WallCells(scored.supported, scored.directions_rad, cell_m), parameters.walls)
    walls = generous_walls(scored, count_walls, parameters)
    plan = generous_floor_plan(walls, part.free, direction, cell_m, parameters)
    atoms = find_atoms(
        part.free, part.occupied, scored.score, plan.face_of_cell, direction, cell_m, parameters.regions
    )
    answers = answering_network()(atoms.raster)
    steps = np.rint(answers[:2].max(0) * 1000).astype(np.int32)
    height, width = part.free.shape
    shown = part.labels(atoms.frame.back(steps, (height, width)))
    return part.labels(atoms.cells), (shown / 1000).astype(np.float32)


def _floor_plan_picture(painter: Painter, analysis: SnapshotAnalysis) -> Image:
    rooms = analysis.rooms
    image = painter.rooms(rooms.labels, painter.map(faint=True))
    image = painter.outlines(image, rooms.polygons, (60, 60, 60))
    doorways = np.array([doorway.ends_m for doorway in rooms.doorways]).reshape(-1, 4)
    return painter.lines(image, doorways, [(225, 90, 20)] * len(doorways), [3 * SCALE] * len(doorways))


def _spectrum_picture(spectrum: Spectrum, directions_rad: FloatArray) -> Image:
    """Magnitude over both frequencies, bright where a wave is strong, and the directions across it."""
    half = SPECTRUM_SIDE_PX // 2
    reach = (np.arange(SPECTRUM_SIDE_PX) - half + 0.5) / half * SPECTRUM_REACH_PER_M
    # Only half the plane is stored: the other half has the same magnitude, seen from the origin.
    fx, fy = np.meshgrid(reach, reach[::-1])
    fy = np.where(fx < 0, -fy, fy)
    magnitude = np.abs(np.fft.fftshift(spectrum.values, axes=0)).astype(np.float32)
    step_x, step_y = float(spectrum.frequency_x[0, 1]), float(spectrum.frequency_y[1, 0])
    values = cv2.remap(
        cv2.GaussianBlur(magnitude, (0, 0), 2.0),
        (np.abs(fx) / step_x).astype(np.float32),
        (fy / step_y + len(magnitude) // 2).astype(np.float32),
        cv2.INTER_LINEAR,
    )
    shown = np.log1p(values)
    low, high = np.quantile(shown, [0.05, 0.998])
    gray = (255 * ((shown - low) / (high - low)).clip(0, 1)).astype(np.uint8)
    image = np.ascontiguousarray(cv2.applyColorMap(gray, cv2.COLORMAP_MAGMA)[..., ::-1])
    for direction in directions_rad.tolist():
        # A wall's waves run across it.
        across = np.array([np.cos(direction + np.pi / 2), -np.sin(direction + np.pi / 2)])
        for side in (-1, 1):
            start, end = (half + side * length * half * across for length in (0.8, 0.98))
            ends = np.round([start, end]).astype(np.int32)
            cv2.polylines(image, [ends], False, (90, 230, 120), 3, cv2.LINE_AA)
    return image


def growth_picture(log: Path) -> tuple[str, Image]:
    """Draw the rooms at some coverages of a run, side by side, as `figure` and the report do."""
    with tempfile.TemporaryDirectory() as name:
        folder = analyze_log(log, Path(name) / "run", RunOptions(recording=False)).folder
        run = Run(folder)
        plans = [run.plan(run.choose(coverage=each)) for each in TUTORIAL_COVERAGES]
    corners = np.array([plan.bounds_m for plan in plans])
    low, high = corners[:, :2].min(axis=0).tolist(), corners[:, 2:].max(axis=0).tolist()
    drawings = [draw_plan(plan, PANEL, (*low, *high)) for plan in plans]
    return "tutorial_growth", np.hstack([as_pixels(drawing, GROWTH_PANEL_PX) for drawing in drawings])


def comparison_picture(log: Path) -> tuple[str, Image]:
    """Compare a run with the same run that ended half way, as `compare` draws it."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for run, end_s in (("half", HALF_WAY_S), ("whole", None)):
            analyze_log(log, folder / run, RunOptions(end_s=end_s, recording=False))
        compare_runs(Run(folder / "half"), Run(folder / "whole"), folder / "changes", recording=False)
        with PillowImage.open(folder / "changes" / "comparison.png") as picture:
            return "compare", np.asarray(picture)


def _label_colors(count: int) -> NDArray[np.uint8]:
    """Colors (count + 1, 3) of labels, RGB: those of tracks; label 0 is black."""
    return np.array([(0, 0, 0), *(track_color(number) for number in range(1, count + 1))], np.uint8)


def _spread_colors(count: int) -> list[Color]:
    colors: list[Color] = [GRAY]
    colors += [(int(r), int(g), int(b)) for r, g, b in _label_colors(count)[1:]]
    return colors


def _mixed(low: Color, high: Color, share: float) -> Color:
    red, green, blue = (
        round(low_value + (high_value - low_value) * share)
        for low_value, high_value in zip(low, high, strict=True)
    )
    return red, green, blue


def save(path: Path, image: Image) -> None:
    """Store a drawing as a PNG with a palette."""
    picture = PillowImage.fromarray(image).quantize(PALETTE_COLORS, dither=PillowImage.Dither.NONE)
    picture.save(path, optimize=True)


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path, help="where to; docs/images for the documentation")
    folder: Path = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    parameters = Parameters()
    with open_log(METHOD_LOG) as reader:
        snapshot = next(found for found in reader.snapshots() if found.index == METHOD_SNAPSHOT)
    for name, image in (
        *method_pictures(snapshot, parameters),
        growth_picture(TUTORIAL_LOG),
        comparison_picture(TUTORIAL_LOG),
    ):
        save(folder / f"{name}.png", image)
    return 0


if __name__ == "__main__":
    sys.exit(main())
