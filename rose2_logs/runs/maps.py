"""The maps of a run with its rooms in them, read back from its annotated MCAP."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import shapely
from numpy.typing import NDArray

from rose2_logs.config.parameters import OccupancyParameters, ReadingParameters
from rose2_logs.config.selection import Selection
from rose2_logs.errors import LogError
from rose2_logs.io import LogReader, open_source
from rose2_logs.io.opening import DEFAULT_LIMITS
from rose2_logs.io.source import MessageSource
from rose2_logs.model.occupancy import FloatArray, GridGeometry, OccupancySnapshot
from rose2_logs.model.room_plan import PlanMap, PlanRoom
from rose2_logs.outputs.mcap.ros_messages import HIGHEST_VALUE

SEGMENTED_TOPIC, MARKERS_TOPIC = "/rose2/segmented_map", "/rose2/markers"
WALLS_NAMESPACE = "walls"


class RunMaps:
    """The annotated MCAP of a run; a context manager that closes it.

    Parameters
    ----------
    path : path
        The file.
    topic : str
        The map topic.
    limits : ReadingParameters
        How much it may claim: those that its log was read with.
    occupancy : OccupancyParameters, optional
        Which cells were free and which occupied.

    Raises
    ------
    LogError
        If it cannot be opened.
    """

    def __init__(
        self,
        path: Path,
        topic: str,
        limits: ReadingParameters = DEFAULT_LIMITS,
        occupancy: OccupancyParameters | None = None,
    ) -> None:
        self._path, self._topic = path, topic
        self._occupancy = occupancy or OccupancyParameters()
        self._source: MessageSource = open_source(path, limits)

    def __enter__(self) -> RunMaps:
        return self

    def __exit__(self, *ended: object) -> None:
        self._source.close()

    def read(self, log_time_ns: int, rooms: Sequence[PlanRoom]) -> PlanMap:
        """Return the map logged at a time, of several the last, with the cells of the rooms found in it.

        Raises
        ------
        LogError
            If it is not there or cannot be read.
        """
        segmented = self._logged(SEGMENTED_TOPIC, log_time_ns)
        try:
            cells = self._logged(self._topic, log_time_ns).cells
        except LogError:
            cells = segmented.cells
        if cells.shape != segmented.cells.shape:
            cells = segmented.cells
        labels = labels_of_segmented(segmented.cells, segmented.geometry, rooms)
        # Where only the segmented map tells: what belongs to a room is free.
        cells = np.where((cells is segmented.cells) & (labels > 0), np.int8(0), cells)
        return PlanMap(segmented.geometry, cells, labels, self._occupancy)

    def _logged(self, topic: str, log_time_ns: int) -> OccupancySnapshot:
        return LogReader(self._source, topic, Selection(start_ns=log_time_ns, end_ns=log_time_ns)).last()

    def walls_m(self, log_time_ns: int) -> NDArray[np.float64] | None:
        """Ends (N, 2, 2) of the wall segments of a map, None if none are there.

        Raises
        ------
        LogError
            If the file cannot be read.
        """
        return read_marker_lines(self._path, MARKERS_TOPIC, WALLS_NAMESPACE, log_time_ns)


def labels_of_segmented(
    segmented: NDArray[np.int8], geometry: GridGeometry, rooms: Sequence[PlanRoom]
) -> NDArray[np.int32]:
    """Find the rooms of a segmented map's cells; where several share a value, their shapes decide.

    Parameters
    ----------
    segmented : (H, W) int8
        The segmented map.
    geometry : GridGeometry
        Where it lies.
    rooms : sequence of PlanRoom
        The map's rooms.

    Returns
    -------
    (H, W) int32
        Numbers of rooms, 0 for none.
    """
    by_value: dict[int, list[PlanRoom]] = {}
    for room in rooms:
        by_value.setdefault(1 + (room.number - 1) % HIGHEST_VALUE, []).append(room)
    numbers = np.zeros(2**8, np.int32)
    for value, holders in by_value.items():
        numbers[value] = holders[0].number
    labels = numbers[segmented.view(np.uint8)]
    for value, holders in by_value.items():
        if len(holders) > 1:
            row, column = np.nonzero(segmented == value)
            centers = shapely.points(geometry.cell_centers(row, column))
            distances = [shapely.distance(room.shape, centers) for room in holders]
            nearest = np.argmin(np.nan_to_num(distances, nan=np.inf), axis=0)
            labels[row, column] = np.array([room.number for room in holders])[nearest]
    return labels


MARKERS_TYPE = "visualization_msgs/msg/MarkerArray"


def read_marker_lines(path: Path, topic: str, namespace: str, log_time_ns: int) -> FloatArray | None:
    """Read the line list of one namespace from the markers logged at a time, of several the last.

    Returns
    -------
    (N, 2, 2) float or None
        Ends of the lines, meters; None without such markers.

    Raises
    ------
    LogError
        If the file cannot be read.
    """
    from mcap.exceptions import McapError
    from mcap.reader import make_reader
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    lines = None
    try:
        with path.open("rb") as file:
            found = make_reader(file).iter_messages(
                [topic], starting_at=log_time_ns, ending_before=log_time_ns + 1, log_time_order=True
            )
            for schema, channel, message in found:
                if schema is None or schema.name != MARKERS_TYPE or channel.message_encoding != "cdr":
                    continue
                array = store.deserialize_cdr(message.data, MARKERS_TYPE)
                for marker in array.markers:  # type: ignore[attr-defined]
                    if marker.ns == namespace:
                        ends = [(point.x, point.y) for point in marker.points]
                        lines = np.array(ends, np.float64).reshape(-1, 2, 2)
    except (OSError, McapError, ValueError) as error:
        raise LogError(f"{path}: cannot be read: {error}; analyze the log again") from error
    return lines
