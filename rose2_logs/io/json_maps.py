"""Maps in JSON: ``foxglove.Grid``, and ROS messages as bridges between ROS and the web write them."""

from __future__ import annotations

import base64
import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rose2_logs.errors import InvalidMapError
from rose2_logs.io.foxglove_grid import NUMERIC_NAMES, PackedField, PackedGrid, grid_of
from rose2_logs.io.grids import (
    LONGEST_NAME_BYTES,
    MOST_CELLS,
    Decoder,
    Grid,
    check_cells,
    exact_resolution,
    make_grid,
)

DAMAGE = (ValueError, KeyError, TypeError, AttributeError, IndexError, OverflowError, RecursionError)
"""What parsing JSON of another form raises."""


def json_decoder(is_foxglove: bool, most_cells: int = MOST_CELLS) -> Decoder:
    """Return the decoder of maps in JSON.

    Parameters
    ----------
    is_foxglove : bool
        Whether messages are ``foxglove.Grid``, and not ``nav_msgs/OccupancyGrid``.
    most_cells : int
        Number of cells of the largest map that is accepted.
    """
    read = _foxglove_grid if is_foxglove else _occupancy_grid

    def decode(data: memoryview) -> Grid | None:
        try:
            return read(json.loads(bytes(data)), most_cells)
        except InvalidMapError:
            raise
        except DAMAGE as error:
            raise InvalidMapError(
                f"its JSON is not that of a map: {type(error).__name__}: {error}"
            ) from error

    return decode


def _foxglove_grid(message: dict[str, Any], most_cells: int) -> Grid | None:
    fields = tuple(
        PackedField(str(each["name"]), int(each.get("offset", 0)), _numeric_type(each["type"]))
        for each in message["fields"]
    )
    size, pose = message["cell_size"], message["pose"]
    packed = PackedGrid(
        _stamp_ns(message["timestamp"]),
        str(message["frame_id"]),
        _pose(pose),
        int(message["column_count"]),
        (float(size["x"]), float(size["y"])),
        int(message["row_stride"]),
        int(message["cell_stride"]),
        fields,
        base64.b64decode(message["data"], validate=True),
    )
    return grid_of(packed, most_cells)


def _numeric_type(given: Any) -> int:
    """Number of a numeric type, which JSON may give by its name."""
    return NUMERIC_NAMES.index(given) if isinstance(given, str) else int(given)


def _occupancy_grid(message: dict[str, Any], most_cells: int) -> Grid | None:
    header, info = message["header"], message["info"]
    rows, columns = int(info["height"]), int(info["width"])
    check_cells(rows, columns, most_cells)
    given = message["data"]
    if isinstance(given, str):  # rosbridge writes arrays of bytes in base 64
        cells = np.frombuffer(base64.b64decode(given, validate=True), np.int8)
    else:
        cells = _cells_of(given)
    if cells.shape != (rows * columns,):
        raise InvalidMapError(f"it claims {columns} x {rows} cells, but its data has {cells.size}")
    frame = str(header["frame_id"])
    if len(frame) > LONGEST_NAME_BYTES:
        raise InvalidMapError(f"its frame_id is longer than {LONGEST_NAME_BYTES} bytes")
    resolution = exact_resolution(float(info["resolution"]))
    return make_grid(
        _stamp_ns(header["stamp"]), frame, resolution, _pose(info["origin"]), cells.reshape(rows, columns), []
    )


def _cells_of(given: list[Any]) -> NDArray[np.int8]:
    """Cells of a list of numbers; bytes may be given without a sign.

    Raises
    ------
    InvalidMapError
        If one is no number of a byte.
    """
    numbers = np.asarray(given, float)
    wrong = ~((numbers == np.rint(numbers)) & (numbers >= -128) & (numbers <= 255))
    if wrong.any():
        raise InvalidMapError(f"its cell {int(wrong.argmax())} is {given[int(wrong.argmax())]}, not a byte")
    return numbers.astype(np.int64).astype(np.int8)


def _stamp_ns(stamp: dict[str, Any]) -> int:
    seconds = stamp.get("sec", stamp.get("secs", 0))
    rest = next((stamp[name] for name in ("nsec", "nanosec", "nsecs") if name in stamp), 0)
    return int(seconds) * 10**9 + int(rest)


def _pose(pose: dict[str, Any]) -> tuple[float, ...]:
    position, turn = pose["position"], pose["orientation"]
    parts = [position[name] for name in "xyz"] + [turn[name] for name in "xyzw"]
    return tuple(float(part) for part in parts)
