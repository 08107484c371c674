"""The export formats by name, and writing a plan in any of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from rose2_logs.drawing.plan import draw_plan
from rose2_logs.drawing.svg import as_svg
from rose2_logs.errors import ParameterError
from rose2_logs.model.room_plan import RoomPlan
from rose2_logs.outputs.exports.dxf import write_dxf
from rose2_logs.outputs.exports.geojson import plan_geojson
from rose2_logs.outputs.exports.graph import plan_graph
from rose2_logs.outputs.exports.layers import ENDINGS as LAYER_ENDINGS
from rose2_logs.outputs.exports.layers import write_layers
from rose2_logs.outputs.exports.map_server import ENDINGS, write_labeled_map
from rose2_logs.runs.summary import write_json
from rose2_logs.system.files import replacing
from rose2_logs.system.packages import need

FORMATS: dict[str, tuple[str, ...]] = {
    "geojson": (".floor_plan.geojson",),
    "qgis": LAYER_ENDINGS,
    "svg": (".floor_plan.svg",),
    "dxf": (".floor_plan.dxf",),
    "map_server": ENDINGS,
    "graph": (".graph.json",),
}
"""File endings of each format."""


def planned_files(formats: Sequence[str], folder: Path, stem: str) -> list[Path]:
    """Return the files that the formats are written to.

    Raises
    ------
    ParameterError
        If a format is unknown.
    MissingPackageError
        If a format needs a package that is not installed.
    """
    for name in formats:
        if name not in FORMATS:
            raise ParameterError(f"unknown format {name!r}; choose one of {', '.join(FORMATS)}")
    if "dxf" in formats:
        need("ezdxf", "DXF files", extra="dxf")
    return [folder / f"{stem}{ending}" for name in dict.fromkeys(formats) for ending in FORMATS[name]]


def write_plan(plan: RoomPlan, formats: Sequence[str], folder: Path, stem: str) -> list[Path]:
    """Write a plan in one or more formats; existing files are replaced.

    Parameters
    ----------
    plan : RoomPlan
    formats : sequence of str
        Keys of `FORMATS`.
    folder : path
        Output folder; created if needed.
    stem : str
        Start of the file names.

    Returns
    -------
    list of Path
        The written files.

    Raises
    ------
    ParameterError
        If a format is unknown.
    OutputError
        If a file cannot be written.
    """
    files = planned_files(formats, folder, stem)
    writers: dict[str, Callable[[Path], object]] = {
        "geojson": lambda path: write_json(path, plan_geojson(plan)),
        "qgis": lambda path: write_layers(plan, folder, stem),
        "svg": lambda path: _write_text(path, as_svg(draw_plan(plan))),
        "dxf": lambda path: write_dxf(plan, path),
        "graph": lambda path: write_json(path, plan_graph(plan)),
        "map_server": lambda path: write_labeled_map(plan, folder, stem),
    }
    for name in dict.fromkeys(formats):
        writers[name](folder / f"{stem}{FORMATS[name][0]}")
    return files


def _write_text(path: Path, text: str) -> None:
    with replacing(path) as part:
        part.write_text(text, encoding="utf-8")
