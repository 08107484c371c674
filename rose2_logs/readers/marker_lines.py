"""Lines among the markers of an annotated MCAP, read back: walls, which no table holds."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rose2_logs.errors import LogError
from rose2_logs.occupancy import FloatArray

MARKERS_TYPE = "visualization_msgs/msg/MarkerArray"


def read_marker_lines(path: Path, topic: str, namespace: str, log_time_ns: int) -> FloatArray | None:
    """Read the line list of one namespace from the markers logged at a time, of several the last.

    Returns
    -------
    (N, 2, 2) float or None
        Ends of the lines, metres; None without such markers.

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
