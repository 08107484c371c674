"""Floor plans as layers for QGIS: a GeoJSON file for each kind of thing, and beside it how QGIS draws it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rose2_logs.drawing.map_painter import DOORWAY_COLOR, INK
from rose2_logs.drawing.plan import SEEN_OPACITY
from rose2_logs.drawing.shapes import Color
from rose2_logs.model.room_plan import RoomPlan
from rose2_logs.outputs.exports.geojson import feature_collection, plan_features
from rose2_logs.runs.summary import write_json
from rose2_logs.system.files import replacing

NORMAL, MULTIPLIED = 0, 6
"""QGIS's numbers of ways to lay one layer over another."""


@dataclass(frozen=True)
class Layer:
    """A layer.

    Attributes
    ----------
    kind : str
        Of its features.
    symbol, simple : str
        Type of QGIS's symbol, and of the layer within it.
    properties : dict
        Of the latter.
    colored : str
        Which of them is the color of the room.
    opacity : float
        Of the whole, in [0, 1].
    blending : int
        How it is laid over the layers below, `NORMAL` or `MULTIPLIED`.
    """

    kind: str
    symbol: str
    simple: str
    properties: dict[str, str]
    colored: str = ""
    opacity: float = 1.0
    blending: int = NORMAL


def _rgba(color: Color) -> str:
    return "{},{},{},255".format(*color)


LAYERS = {
    "rooms": Layer(
        "room",
        "fill",
        "SimpleFill",
        {"style": "solid", "outline_color": "80,80,80,255", "outline_width": "0.2"},
        "fillColor",
        SEEN_OPACITY,
        # Doorways are seen through it: files dragged into QGIS lie in the order of their names.
        MULTIPLIED,
    ),
    "unseen": Layer(
        "predicted", "fill", "SimpleFill", {"style": "b_diagonal", "outline_style": "no"}, "fillColor"
    ),
    "walls": Layer(
        "wall", "fill", "SimpleFill", {"style": "solid", "color": _rgba(INK), "outline_style": "no"}
    ),
    "doorways": Layer(
        "doorway", "line", "SimpleLine", {"line_color": _rgba(DOORWAY_COLOR), "line_width": "0.8"}
    ),
}
"""Layers by name."""
ENDINGS = tuple(f".{name}.{ending}" for name in LAYERS for ending in ("geojson", "qml"))
LABEL = "name || '\\n' || format_number(area_m2, 1) || ' m²'"
"""Expression of QGIS for the label of a room."""
LABEL_SIZE_PT = 9


def write_layers(plan: RoomPlan, folder: Path, stem: str) -> None:
    """Write each kind of thing in a plan to a file of its own; QGIS takes the style beside it by its name.

    Raises
    ------
    OutputError
        If a file cannot be written.
    """
    features = plan_features(plan)
    for name, layer in LAYERS.items():
        data, style = (folder / f"{stem}.{name}.{ending}" for ending in ("geojson", "qml"))
        write_json(data, feature_collection(plan, name, features[layer.kind]))
        with replacing(style) as part:
            part.write_text(_style(layer), encoding="utf-8")


def _style(layer: Layer) -> str:
    """Return how QGIS draws a layer, in its own format."""
    properties = "".join(f'<prop k="{name}" v="{value}"/>' for name, value in layer.properties.items())
    colored = ""
    if layer.colored:
        colored = (
            '<data_defined_properties><Option type="Map"><Option name="name" type="QString" value=""/>'
            f'<Option name="properties" type="Map"><Option name="{layer.colored}" type="Map">'
            '<Option name="active" type="bool" value="true"/><Option name="field" type="QString" '
            'value="color"/><Option name="type" type="int" value="2"/></Option></Option>'
            '<Option name="type" type="QString" value="collection"/></Option></data_defined_properties>'
        )
    labels = ""
    if layer.kind == "room":
        labels = (
            f'<labeling type="simple"><settings><text-style fieldName="{LABEL}" isExpression="1" '
            f'fontSize="{LABEL_SIZE_PT}" fontSizeUnit="Point" textColor="{_rgba(INK)}"><text-buffer '
            'bufferDraw="1" bufferSize="0.8" bufferSizeUnits="MM" bufferColor="255,255,255,255"/>'
            '</text-style><placement placement="1"/></settings></labeling>'
        )
    return (
        "<!DOCTYPE qgis PUBLIC 'http://mrcc.com/qgis.dtd' 'SYSTEM'>\n"
        f'<qgis version="3.22" styleCategories="Symbology|Labeling" labelsEnabled="{int(bool(labels))}">\n'
        f'<renderer-v2 type="singleSymbol"><symbols><symbol name="0" type="{layer.symbol}" '
        f'alpha="{layer.opacity:g}"><layer class="{layer.simple}" enabled="1" locked="0" pass="0">'
        f"{properties}{colored}</layer></symbol></symbols></renderer-v2>\n{labels}\n"
        f"<blendMode>{layer.blending}</blendMode>\n</qgis>\n"
    )
