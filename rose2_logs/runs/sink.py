"""What an output of a run is: it receives finished steps in order and never feeds back."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rose2_logs.config.parameters import Parameters
from rose2_logs.errors import ParameterError
from rose2_logs.tracking.back_projection import BackProjectedSnapshot
from rose2_logs.tracking.tracked_snapshot import TrackedSnapshot

if TYPE_CHECKING:
    from rose2_logs.runs.history import RunSummary


@dataclass(frozen=True)
class RunInfo:
    """What is known of a run before its first map.

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

    Examples
    --------
    >>> import rose2_logs as rl
    >>> class Heading(rl.Sink):
    ...     def begin(self, info):
    ...         print(info.topic, info.method, info.provenance["format"])
    ...
    ...     def write(self, step):
    ...         pass
    >>> run = rl.analyze("sample_logs/office.mcap", sinks=[Heading()], max_snapshots=2)
    /map rose2 MCAP
    """

    log_path: Path
    topic: str
    method: str
    parameters: Parameters
    versions: dict[str, str]
    provenance: dict[str, Any]
    origin: str | None = None

    def __repr__(self) -> str:
        return f"RunInfo({self.log_path.name!r}, topic={self.topic!r}, method={self.method!r})"


class Sink:
    """An output of a run. Derive from it and override what is needed; `write` is the least.

    The calls come in this order: `begin`, `write` for each map, `write_back_projected` for each map once more
    if the run projects its last layout back, `finish`. If the run fails, also within one of these calls,
    `abandon` comes instead of what is left, and nothing half written may stay.

    Attributes
    ----------
    facts : mapping
        JSON values to add to ``summary.json``, under names no other sink uses; read after `finish`.

    Examples
    --------
    >>> import rose2_logs as rl
    >>> class RoomCounter(rl.Sink):
    ...     def __init__(self):
    ...         self.counts = []
    ...
    ...     def write(self, step):
    ...         self.counts.append(len(step.rooms))
    >>> counter = RoomCounter()
    >>> run = rl.analyze("sample_logs/office.mcap", sinks=[counter], max_snapshots=3)
    >>> len(counter.counts)
    3
    """

    facts: Mapping[str, Any] = {}

    def begin(self, info: RunInfo) -> None:
        """Get ready for the first map."""

    def write(self, step: TrackedSnapshot) -> None:
        """Take the next map with all that was found in it."""
        raise NotImplementedError

    def write_back_projected(self, found: BackProjectedSnapshot) -> None:
        """Take what a map shows of the last map's rooms: all maps again in order, after the last one."""

    def finish(self, summary: RunSummary) -> None:
        """Complete the output: write it under a hidden name first, then rename it."""

    def abandon(self) -> None:
        """Remove what was begun, if anything: the run has failed. Called once at most."""


def as_sinks(given: Any) -> list[Sink]:
    """Return a list of sinks; anything with methods `begin`, `write` and `finish` is made one.

    Raises
    ------
    ParameterError
        If it is no list, or an entry lacks one of these methods.
    """
    if not isinstance(given, list | tuple):
        raise ParameterError(f"sinks must be a list of sinks, not {given!r:.60}")
    return [_as_sink(each) for each in given]


def _as_sink(given: Any) -> Sink:
    if isinstance(given, Sink):
        if type(given).write is Sink.write:
            raise ParameterError(f"the sink {type(given).__name__} has no method write(step)")
        return given
    for name in ("begin", "write", "finish"):
        if isinstance(given, type) or not callable(getattr(given, name, None)):
            raise ParameterError(
                f"a sink needs the methods begin, write and finish, which {given!r:.60} has not; "
                "derive from rose2_logs.Sink"
            )
    return _WrappedSink(given)


class _WrappedSink(Sink):
    """Something with the methods of a sink; those that it lacks do nothing."""

    def __init__(self, given: Any) -> None:
        self._given = given
        self.begin, self.write, self.finish = given.begin, given.write, given.finish  # type: ignore[method-assign]
        for name in ("write_back_projected", "abandon"):
            if callable(method := getattr(given, name, None)):
                setattr(self, name, method)

    @property
    def facts(self) -> Mapping[str, Any]:  # type: ignore[override]
        return getattr(self._given, "facts", {})


@contextmanager
def abandoned_on_error(sinks: Sequence[Sink]) -> Iterator[None]:
    """Let sinks remove what they have begun if anything fails within, the last one first.

    A sink that fails to do so does not keep the others from it.
    """
    try:
        yield
    except BaseException:
        _abandon(list(sinks))
        raise


def _abandon(sinks: list[Sink]) -> None:
    if sinks:
        try:
            sinks.pop().abandon()
        finally:
            _abandon(sinks)
