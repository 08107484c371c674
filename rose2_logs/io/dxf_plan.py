"""Named outlines of rooms from drawings of CAD programs, read by ezdxf."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from rose2_logs.model.room_names import RoomNames, room_name
from rose2_logs.system.packages import need

NO_NAME = re.compile(r"[\d.,\s]*(m2|m²|sqm|qm)?", re.IGNORECASE)
"""Texts in rooms that are no names: areas, and numbers alone, as of doors and dimensions."""
LABELS = "LABELS"
"""Layer of an exported plan with the names of rooms."""
OF_NUMBER = re.compile(room_name(0).replace("0", r"\d+"))
"""What an exported plan calls a room that nobody has named."""


def read_dxf_plan(path: Path) -> RoomNames:
    """Read closed polylines, each named by the text in it.

    A text names the smallest outline around it. Of several texts in an outline the largest counts, of
    these the upper one; areas and numbers are no names, nor is what an exported plan calls a room that nobody
    has named. Lengths are converted to meters by the unit of the drawing; one without a unit is in meters.

    Raises
    ------
    ValueError
        If it is no DXF that ezdxf can read.
    MissingPackageError
        If ezdxf is not installed.
    """
    need("ezdxf", "DXF files", extra="dxf")
    import ezdxf
    from ezdxf import units
    from ezdxf.entities.lwpolyline import LWPolyline
    from ezdxf.entities.mtext import MText
    from ezdxf.entities.polyline import Polyline
    from ezdxf.entities.text import Text
    from ezdxf.enums import InsertUnits

    try:
        document = ezdxf.readfile(path)  # type: ignore[attr-defined]
    except (ezdxf.DXFError, OSError) as error:  # type: ignore[attr-defined]
        # Of what is no DXF at all it says so by an OSError.
        raise ValueError(str(error)) from error
    to_m = 1.0
    if document.units:
        to_m = units.conversion_factor(InsertUnits(document.units), InsertUnits.Meters)
    outlines = []
    texts = []
    for entity in document.modelspace():
        match entity:
            case LWPolyline() if entity.closed:
                outlines.append(_outline([(x, y) for x, y, *_ in entity.get_points()], to_m))
            case Polyline() if entity.is_closed:
                outlines.append(_outline([(x, y) for x, y, _ in entity.points()], to_m))
            case Text():
                _, at, _ = entity.get_placement()
                texts.append((entity.dxf.height, at.y, at.x, entity.plain_text(), entity.dxf.layer))
            case MText():
                at = entity.dxf.insert
                text = " ".join(entity.plain_text(split=True))
                texts.append((entity.dxf.char_height, at.y, at.x, text, entity.dxf.layer))
    shapes = np.array(outlines, object)
    areas = shapely.area(shapes)
    named: dict[int, str] = {}
    # The last one that is put down stays.
    for _, y, x, text, layer in sorted(texts):
        name = " ".join(text.split())
        around = np.flatnonzero((areas > 0) & shapely.contains_xy(shapes, x * to_m, y * to_m))
        if len(around) and not NO_NAME.fullmatch(name):
            is_given = layer != LABELS or not OF_NUMBER.fullmatch(name)
            named[int(around[areas[around].argmin()])] = name if is_given else ""
    return RoomNames({}, tuple(outlines[place] for place in named), tuple(named.values()))


def _outline(points: list[tuple[float, float]], to_m: float) -> BaseGeometry:
    """Polygon of the corners of a closed line; empty where they are fewer than three."""
    if len(points) < 3:
        return shapely.Polygon()
    return shapely.make_valid(shapely.Polygon(np.array(points, float) * to_m))
