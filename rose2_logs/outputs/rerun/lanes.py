"""Each room's history as a lane over the run, and how right the layout was: known when the run is over."""

from __future__ import annotations

from array import array

import numpy as np
import rerun as rr

from rose2_logs.drawing.palette import FORMING, SETTLED, SHAPED, TEMPORARY, state_colors
from rose2_logs.model.room_names import NameOf, room_name
from rose2_logs.outputs.rerun.layers import Instant, time_columns
from rose2_logs.tracking.convergence import Convergence
from rose2_logs.tracking.track_history import SnapshotRef

LANES = "/room"
FINAL_SHARE, KNOWN_FINAL_SHARE, FINAL_IOU = "/run/final_share", "/run/known_final_share", "/run/final_iou"
SHIFTS = "/run/map_shifted"
"""Marks upon the curve of coverage where the whole map shifted."""
LOST = ""
"""Ends a state: a gap in the lane."""


class TrackLanes:
    """Gathers when which rooms were there: some numbers a map.

    Parameters
    ----------
    recording : RecordingStream
        Where to.
    name_of : callable
        Name of a room by its track.
    """

    def __init__(self, recording: rr.RecordingStream, name_of: NameOf = room_name) -> None:
        self._recording = recording
        self._name_of = name_of
        # The times of each map, one after the other: as objects they would take several times as much.
        self._times = array("q")
        # For each track the indices of instants at which it appears and is gone, in turns.
        self._turns: dict[int, list[int]] = {}
        self._shown: set[int] = set()

    def add(self, instant: Instant, track_ids: tuple[int, ...]) -> None:
        """Take one map."""
        now = set(track_ids)
        for track in sorted(now ^ self._shown):
            self._turns.setdefault(track, []).append(self._maps)
        self._shown = now
        self._times.extend(instant)

    def log(self, convergence: Convergence) -> None:
        """Log everything, once, after the last map."""
        instants = [
            Instant(*each) for each in np.array(self._times).reshape(-1, len(Instant._fields)).tolist()
        ]
        number = {instant.snapshot: index for index, instant in enumerate(instants)}
        for track, turns in sorted(self._turns.items()):
            changes = (
                self._changes(track, turns, number, convergence)
                if track in self._shown
                else self._presence(turns)
            )
            path = f"{LANES}/{track}"
            tints = state_colors(track)
            looks = rr.StateConfiguration(
                values=list(tints),
                labels=[f"{self._name_of(track)}: {state}" for state in tints],
                colors=list(tints.values()),
            )
            self._recording.log(path, looks, static=True)
            times = time_columns([instants[index] for index in changes])
            states = rr.StateChange.columns(state=list(changes.values()))
            self._recording.send_columns(path, times, states)
        for path, figures in (
            (FINAL_SHARE, convergence.final_share),
            (KNOWN_FINAL_SHARE, convergence.known_final_share),
            (FINAL_IOU, convergence.final_iou),
        ):
            known = [(at, figures.get(at.snapshot)) for at in instants]
            points = [(at, value) for at, value in known if value is not None]
            if points:
                values = rr.Scalars.columns(scalars=np.array([100 * value for _, value in points]))
                self._recording.send_columns(path, time_columns([at for at, _ in points]), values)

    @property
    def _maps(self) -> int:
        return len(self._times) // len(Instant._fields)

    @staticmethod
    def _presence(turns: list[int]) -> dict[int, str]:
        """State of a room that was gone in the end: only that it was there, from each index on."""
        return {index: LOST if place % 2 else TEMPORARY for place, index in enumerate(turns)}

    def _changes(
        self, track: int, turns: list[int], number: dict[int, int], convergence: Convergence
    ) -> dict[int, str]:
        """State of a room from each index on where it changes, in order."""

        def index_of(snapshot_ref: SnapshotRef | None) -> int:
            return self._maps if snapshot_ref is None else number[snapshot_ref.snapshot]

        shaped = index_of(convergence.shape_right.get(track))
        settled = index_of(convergence.area_settled.get(track))
        ends = [*turns, self._maps] if len(turns) % 2 else turns
        changes: dict[int, str] = {}
        for begin, end in zip(ends[::2], ends[1::2], strict=True):
            for index in sorted({begin, *(each for each in (shaped, settled) if begin < each < end)}):
                changes[index] = SETTLED if index >= settled else SHAPED if index >= shaped else FORMING
            if end < self._maps:
                changes[end] = LOST
        return changes
