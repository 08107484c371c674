"""Names of rooms from files: tables of tracks or points, and floor plans with named outlines."""

from __future__ import annotations

import csv
import io
import json
import math
from pathlib import Path
from typing import Any

import shapely
from shapely.geometry.base import BaseGeometry

from rose2_logs.errors import ParameterError
from rose2_logs.io.dxf_plan import read_dxf_plan
from rose2_logs.model.room_names import RoomNames, room_name

PLAN_ENDINGS = (".geojson", ".json", ".dxf")
"""Files with outlines; all others are tables."""
HELP = "a table of names needs a first line with the columns name and track, or name, x and y"
MOST_BYTES = 50_000_000
"""A building has some hundred rooms; a larger file is another one."""


def is_plan(path: Path) -> bool:
    """Whether a file holds outlines, in a frame of its own, and not tracks and points of the run."""
    return path.suffix.lower() in PLAN_ENDINGS


def read_room_names(path: Path) -> RoomNames:
    """Read names of rooms.

    Parameters
    ----------
    path : path
        A table (CSV) with the columns ``name`` and ``track``, or ``name``, ``x`` and ``y`` in meters of the
        map's frame; or GeoJSON with polygons that have the property ``name``; or DXF, see `read_dxf_plan`.
        What an exported plan calls by its number has no name; its outline helps to lay the plan over a map.

    Raises
    ------
    ParameterError
        If it cannot be read, or holds no name; the message names the line or the feature.
    """
    try:
        if path.stat().st_size > MOST_BYTES:
            raise ParameterError(f"{path}: is too large for names of rooms")
        if path.suffix.lower() == ".dxf":
            return _known(path, _drawing(path))
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        why = error.strerror if isinstance(error, OSError) else "it is no text in UTF-8"
        raise ParameterError(f"{path}: names of rooms cannot be read: {why}") from error
    names = _plan(path, text) if is_plan(path) else _table(path, text)
    return _known(path, names)


def _known(path: Path, names: RoomNames) -> RoomNames:
    if not names.by_track and not any(names.of_place):
        raise ParameterError(f"{path}: holds no name of a room")
    return names


def _drawing(path: Path) -> RoomNames:
    try:
        return read_dxf_plan(path)
    except (ValueError, LookupError, TypeError, AttributeError, shapely.errors.ShapelyError) as error:
        why = " ".join(str(error).split()) or type(error).__name__
        raise ParameterError(f"{path}: is no DXF of outlines with names: {why[:120]}") from error


def _table(path: Path, text: str) -> RoomNames:
    first, _, _ = text.partition("\n")
    rows = csv.DictReader(io.StringIO(text), delimiter=max(",;\t", key=first.count), strict=True)
    by_track: dict[int, str] = {}
    places: list[BaseGeometry] = []
    of_place: list[str] = []
    try:
        columns = {str(name).strip().lower(): name for name in rows.fieldnames or ()}
        if "name" not in columns or not ("track" in columns or {"x", "y"} <= columns.keys()):
            raise ParameterError(f"{path}: {HELP}")
        for row in rows:
            track, x, y, name = (
                " ".join((row.get(columns.get(key, "")) or "").split()) for key in ("track", "x", "y", "name")
            )
            at = f"{path}: line {rows.line_num}"
            if not (track or x or y or name):
                continue
            if not name:
                raise ParameterError(f"{at}: has no name")
            if track:
                number = _track(track, at)
                if by_track.get(number, name) != name:
                    raise ParameterError(f"{at}: track {number} has another name above")
                by_track[number] = name
            else:
                places.append(shapely.Point(_meters(x, "x", at), _meters(y, "y", at)))
                of_place.append(name)
    except csv.Error as error:
        raise ParameterError(f"{path}: line {rows.line_num}: {error}") from error
    return RoomNames(by_track, tuple(places), tuple(of_place))


def _track(text: str, at: str) -> int:
    if not text.isascii() or not text.isdigit() or not 0 < int(text) < 2**31:
        raise ParameterError(f"{at}: the track is {text[:40]!r}; it must be the number of a room, 1 or more")
    return int(text)


def _meters(text: str, name: str, at: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ParameterError(f"{at}: {name} is {text[:40]!r}; it must be a number of meters")
    return value


def _given_name(properties: dict[str, Any]) -> str:
    """Name of a feature, empty where it is what an exported plan calls a room that nobody has named."""
    name = " ".join(properties["name"].split())
    number = properties.get("room")
    # Programs write whole numbers as 4.0 where other features have none.
    if isinstance(number, int | float) and float(number).is_integer() and name == room_name(int(number)):
        return ""
    return name


def _plan(path: Path, text: str) -> RoomNames:
    try:
        content: Any = json.loads(text)
        features = content["features"]
        named = [
            (shapely.geometry.shape(feature["geometry"]), _given_name(feature["properties"]))
            for feature in features
            if (feature.get("properties") or {}).get("name")
            and (feature.get("geometry") or {}).get("type") in ("Polygon", "MultiPolygon")
        ]
        shapes = [shapely.make_valid(shape) for shape, _ in named]
        if not all(math.isfinite(value) for shape in shapes for value in shape.bounds):
            raise ValueError("an outline is not finite")
    except (
        ValueError,
        LookupError,
        TypeError,
        AttributeError,
        RecursionError,
        shapely.errors.ShapelyError,
    ) as error:
        why = " ".join(str(error).split()) or type(error).__name__
        raise ParameterError(f"{path}: is no GeoJSON of outlines with names: {why[:120]}") from error
    return RoomNames({}, tuple(shapes), tuple(name for _, name in named))
