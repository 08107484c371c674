"""Events of rooms and of the whole map in words."""

from __future__ import annotations

import math

from rose2_logs.model.room_names import NameOf, room_name
from rose2_logs.tracking.tracked_snapshot import RoomEvent


def event_text(event: RoomEvent, name_of: NameOf = room_name) -> str:
    """Describe an event in a sentence, with the names of its rooms."""
    if event.kind == "part_begun":
        return "the map was begun anew: a new part of the run"
    if event.motion is not None:
        (x, y), turn_deg = event.motion.shift_xy_m, math.degrees(event.motion.turn_rad)
        return f"the map shifted by {x:+.2f}, {y:+.2f} m and turned by {turn_deg:+.1f}°"
    room, others = name_of(event.track), ", ".join(map(name_of, event.others))
    if event.kind == "split":
        return f"{room} split: now also {others}" if others else f"{room} split"
    if event.kind == "merged":
        return f"{room} merged with {others}" if others else f"{room} merged"
    return f"{room} {event.kind}"
