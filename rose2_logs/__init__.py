"""Rooms and structure of buildings from the maps in robot logs: ROSE2 along an exploration run.

What is offered here is imported when it is used. `rose2_logs.analyze` does the main job.
"""

import importlib
from typing import Any

__version__ = "0.2.0"

_HOMES = {
    "api": (
        "analyze",
        "compare",
        "evaluate",
        "load",
        "map_topics",
        "open_log",
        "read_map",
        "segment",
        "track",
    ),
    "config.parameters": ("Parameters",),
    "config.run_options": ("RunOptions",),
    "config.selection": ("Selection",),
    "comparison.layouts": ("LayoutComparison",),
    "drawing.drawing": ("Drawing",),
    "errors": (
        "AlreadyWholeError",
        "CasesError",
        "InvalidMapError",
        "LogError",
        "MissingPackageError",
        "NoMapTopicError",
        "OutputError",
        "ParameterError",
        "ResultsError",
        "Rose2LogsError",
    ),
    "io.log": ("LogReader",),
    "model.analysis": ("FloorPlan", "SnapshotAnalysis", "Structure", "Walls"),
    "model.borders": ("Border",),
    "model.occupancy": ("GridGeometry", "OccupancySnapshot"),
    "model.room_plan": ("RoomPlan",),
    "model.rooms": ("Doorway", "RoomMap"),
    "runs.history": ("RunSummary",),
    "runs.run": ("Run", "RunSnapshot"),
    "runs.sink": ("RunInfo", "Sink"),
    "runs.table": ("Table",),
    "system.warnings": ("StrictError",),
    "system.workers": ("WorkerError",),
    "tracking.tracked_snapshot": ("RoomEvent", "TrackedSnapshot"),
    "workflows.evaluate": ("Evaluation",),
    "workflows.segment": ("Segmentation",),
}
"""Where each public name is defined; ``__init__.pyi`` says the same to type checkers."""
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = ["__version__", *sorted(_HOME_OF)]  # noqa: PLE0604 (names, all of them text)


def __getattr__(name: str) -> Any:
    home = _HOME_OF.get(name)
    if home is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(f"{__name__}.{home}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
