"""What a run is to take from a log, do with it, and write."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from rose2_logs.config.parameters import Parameters
from rose2_logs.config.selection import Selection

RECORDING_LAYERS = (
    "predicted",
    "path",
    "clean_map",
    "score",
    "spectrum",
    "segments",
    "lines",
    "faces",
    "voronoi",
)
"""Layers of a recording that can be left out; map, rooms and doorways are always there."""

NOT_IN_JOURNAL = (
    *("topic", "selection", "parameters", "workers", "recording", "layers", "annotated_log", "bag"),
    *("live", "back_project", "origin", "home", "overwrite", "resume", "journal", "strict"),
)
"""Options that the analysis does not depend on, or that a journal names otherwise."""


@dataclass(frozen=True)
class RunOptions:
    """What to take from a log, what to do with it, what to write.

    Attributes
    ----------
    topic : str, optional
        The map topic; by default ``/map``, else the only one.
    selection : Selection
        Which maps.
    parameters : Parameters
        Of all stages.
    method : str
        The segmentation method.
    workers : int
        Processes; results do not depend on it. A script that asks for several does so under
        ``if __name__ == "__main__"``, as each of them imports it.
    recording, annotated_log : bool
        Whether to write the Rerun recording and the annotated MCAP. The tables are always written.
    bag : bool
        Whether the folder becomes a bag of ROS 2 that holds the annotated MCAP.
    layers : tuple of str
        Those of `RECORDING_LAYERS` that the recording gets.
    back_project : bool
        Whether to go through the maps once more in the end and tell how much of the last map's rooms each
        shows.
    live : bool
        Also send the recording to an open Rerun viewer.
    overwrite : bool
        Whether results of an earlier run may be replaced.
    resume : bool
        Whether to go on where a run of the same log and parameters was stopped; without one, begin anew.
    journal : bool
        Whether to keep what is found on the way beside the folder, so that a run that is stopped can go on.
    origin : str, optional
        What the summary names as the log; by default its path. For a log that was copied to be read.
    home : path, optional
        The folder in which the results will stand, if they are moved there afterwards.
    strict : bool
        Whether the first warning about the log is an error.
    """

    topic: str | None = None
    selection: Selection = field(default_factory=Selection)
    parameters: Parameters = field(default_factory=Parameters)
    method: str = "rose2"
    workers: int = 1
    recording: bool = True
    annotated_log: bool = True
    bag: bool = False
    layers: tuple[str, ...] = RECORDING_LAYERS
    back_project: bool = False
    live: bool = False
    overwrite: bool = False
    resume: bool = False
    journal: bool = True
    origin: str | None = None
    home: Path | None = None
    strict: bool = False

    @property
    def shown_layers(self) -> tuple[str, ...]:
        """The layers that a recording, stored or live, is going to show."""
        return self.layers if self.recording or self.live else ()
