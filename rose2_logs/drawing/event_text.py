"""Events of rooms and of the whole map in words."""

from __future__ import annotations

import math

from rose2_logs.tracking.tracked_snapshot import RoomEvent


def event_text(event: RoomEvent) -> str:
    """Describe an event in a sentence."""
    if event.kind == "part_begun":
        return "the map was begun anew: a new part of the run"
    if event.motion is not None:
        (x, y), turn_deg = event.motion.shift_xy_m, math.degrees(event.motion.turn_rad)
        return f"the map shifted by {x:+.2f}, {y:+.2f} m and turned by {turn_deg:+.1f}°"
    others = ", ".join(str(track) for track in event.others)
    if event.kind == "split":
        return f"room {event.track} split; new: {others}" if others else f"room {event.track} split"
    if event.kind == "merged":
        return (
            f"room {event.track} merged with room{'s' * (len(event.others) > 1)} {others}"
            if others
            else f"room {event.track} merged"
        )
    return f"room {event.track} {event.kind}"
