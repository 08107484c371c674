"""Named outlines of rooms from drawings of CAD programs, read by ezdxf."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import shapely

from rose2_logs.model.room_names import RoomNames

NO_NAME = re.compile(r"[\d.,\s]*(m2|m²|sqm|qm)?", re.IGNORECASE)
"""Texts in rooms that are no names: areas, and numbers alone, as of doors and dimensions."""


def read_dxf_plan(path: Path) -> RoomNames:
    """Read closed polylines, each named by the text in it.

    A text names the smallest outline around it. Of several texts in an outline the largest counts, of
    these the upper one; areas and numbers are no names. Lengths are converted to meters by the unit of the
    drawing; one without a unit is in meters.

    Raises
    ------
    ValueError
        If it is no DXF that ezdxf can read.
    """
    import ezdxf
    from ezdxf import units

    try:
        document = ezdxf.readfile(path)  # type: ignore[attr-defined]
    except (ezdxf.DXFError, OSError) as error:  # type: ignore[attr-defined]
        # Of what is no DXF at all it says so by an OSError.
        raise ValueError(str(error)) from error
    to_m = units.conversion_factor(document.units, units.M) if document.units else 1.0
    space = document.modelspace()
    rings = []
    for line in space.query("LWPOLYLINE POLYLINE"):
        points = [
            point[:2] for point in (line.vertices() if line.dxftype() == "LWPOLYLINE" else line.points())
        ]
        is_closed = bool(line.closed if line.dxftype() == "LWPOLYLINE" else line.is_closed)
        if is_closed and len(points) >= 3:
            rings.append(shapely.make_valid(shapely.Polygon(np.array(points, float) * to_m)))
    texts = []
    for text in space.query("TEXT MTEXT"):
        name = " ".join((text.plain_text() if text.dxftype() == "MTEXT" else text.dxf.text).split())
        if not NO_NAME.fullmatch(name):
            height = text.dxf.char_height if text.dxftype() == "MTEXT" else text.dxf.height
            at = text.dxf.insert if text.dxftype() == "MTEXT" else text.get_placement()[1]
            texts.append((height, at[1], at[0], name))
    outlines = np.array(rings, object)
    areas = shapely.area(outlines)
    named: dict[int, str] = {}
    # The last one that is put down stays.
    for _, y, x, name in sorted(texts):
        around = np.flatnonzero(shapely.contains_xy(outlines, x * to_m, y * to_m))
        if len(around):
            named[int(around[areas[around].argmin()])] = name
    return RoomNames({}, tuple(rings[place] for place in named), tuple(named.values()))
