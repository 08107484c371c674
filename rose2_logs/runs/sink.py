"""What every sink is: a context manager that receives finished snapshots in order and never feeds back."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol, Self, runtime_checkable

from rose2_logs.config.parameters import Parameters
from rose2_logs.tracking.back_projection import BackProjectedSnapshot
from rose2_logs.tracking.tracked_snapshot import TrackedSnapshot


@dataclass(frozen=True)
class RunInfo:
    """What a sink knows of the run before the first snapshot.

    Attributes
    ----------
    log_path : path
        The log that is analyzed.
    topic : str
        The map topic.
    method : str
        The segmentation method.
    parameters : Parameters
        The resolved parameters.
    versions : dict
        Versions of the tool and of the packages that results depend on.
    provenance : dict
        What is known of the input: format, size in bytes, SHA-256 fingerprint; JSON values only.
    origin : str, optional
        Where the log comes from if `log_path` is but a copy.
    place : dict, optional
        Where the log lies on this machine, see `provenance.log_location`; none of a copy.
    """

    log_path: Path
    topic: str
    method: str
    parameters: Parameters
    versions: dict[str, str]
    provenance: dict[str, Any]
    origin: str | None = None
    place: dict[str, str | None] | None = None


class Sink(Protocol):
    """Receives every snapshot of a run in order.

    Leaving the context without an exception makes the output whole: it is written beside its final name and
    renamed; leaving it by an exception removes what was begun.
    """

    def __enter__(self) -> Self: ...

    def write(self, step: TrackedSnapshot) -> None:
        """Take one snapshot."""
        ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None: ...


@runtime_checkable
class BackProjectedSink(Protocol):
    """Also receives, after the last snapshot, all of them again by the layout of the last."""

    def write_back_projected(self, found: BackProjectedSnapshot) -> None:
        """Take one snapshot of the second pass."""
        ...


@runtime_checkable
class CopyingSink(Protocol):
    """A sink that copies the log too.

    Attributes
    ----------
    copied : dict
        What went in and what came out, for the summary, once the output is whole; JSON values.
    """

    copied: dict[str, Any]
