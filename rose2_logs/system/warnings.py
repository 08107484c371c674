"""Warnings about a log, with machine-readable details; collected, counted, or treated as errors."""

from __future__ import annotations

import logging
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rose2_logs.errors import Rose2LogsError

PACKAGE = "rose2_logs"
"""Name of this package's top logger."""
FIRST_KEPT = 5
"""Number of warnings of one kind whose text is kept; the rest are only counted."""
FIELDS = ("kind", "file", "topic", "index")
"""Attributes of a log record besides its text, see `log_warning`."""

NOT_OF_LOG = "no_effect"
"""Kind of warnings about the parameters."""
UNCOUNTED = {"is_counted": False}
"""Passed as `extra` with warnings about how a run proceeds, which do not belong to its results."""

_is_muted: ContextVar[bool] = ContextVar("_is_muted", default=False)


@contextmanager
def muted() -> Iterator[None]:
    """Suppress warnings while the context lasts, for reading again what has been warned about before."""
    token = _is_muted.set(True)
    try:
        yield
    finally:
        _is_muted.reset(token)


class StrictError(Rose2LogsError):
    """A warning, when warnings are treated as errors."""


def log_warning(
    logger: logging.Logger,
    kind: str,
    text: str,
    *,
    file: Path | str | None = None,
    topic: str | None = None,
    index: int | None = None,
    level: int = logging.WARNING,
) -> None:
    """Log a warning with its details.

    Parameters
    ----------
    logger : Logger
        Logger of the calling module.
    kind : str
        Short name of the kind of warning, by which warnings are counted.
    text : str
        One line that makes sense on its own.
    file : path, optional
        The log, or the file of it, that the warning is about.
    topic : str, optional
        The topic.
    index : int, optional
        Number of the message on its topic, or of the snapshot, from 1.
    level : int
        Level of the `logging` module.
    """
    if _is_muted.get():
        return
    extra = {"kind": kind, "file": None if file is None else str(file), "topic": topic, "index": index}
    logger.log(level, "%s", text, extra=extra)


@dataclass
class WarningsOfKind:
    """How often a kind of warning occurred, and the first few of them."""

    count: int = 0
    first: list[dict[str, Any]] = field(default_factory=list)


@dataclass
class WarningLog:
    """The warnings of a run by kind, in the order of their first occurrence."""

    kinds: dict[str, WarningsOfKind] = field(default_factory=dict)

    @property
    def count(self) -> int:
        """Number of warnings of all kinds."""
        return sum(found.count for found in self.kinds.values())

    def add(self, record: logging.LogRecord) -> None:
        """Add a warning."""
        found = self.kinds.setdefault(getattr(record, "kind", "other"), WarningsOfKind())
        found.count += 1
        if len(found.first) < FIRST_KEPT:
            details = {name: getattr(record, name, None) for name in FIELDS[1:]}
            found.first.append(
                {"message": record.getMessage()} | {k: v for k, v in details.items() if v is not None}
            )

    def rename(self, old: str, new: str) -> None:
        """Replace the name of a log, so that warnings about a local copy refer to the original."""
        for found in self.kinds.values():
            for entry in found.first:
                entry.update({k: v.replace(old, new) for k, v in entry.items() if isinstance(v, str)})

    def as_json(self) -> dict[str, Any]:
        """Return the number of warnings, and the number and the first few of each kind."""
        kinds = {kind: {"count": found.count, "first": found.first} for kind, found in self.kinds.items()}
        return {"count": self.count, "kinds": kinds}

    def texts(self) -> list[str]:
        """Return the texts that were kept, and for each kind a line with the number of the others."""
        lines = []
        for kind, found in self.kinds.items():
            lines += [entry["message"] for entry in found.first]
            if found.count > len(found.first):
                lines.append(f"{found.count - len(found.first)} more warnings of the kind {kind}")
        return lines


@contextmanager
def collect_warnings(strict: bool = False) -> Iterator[WarningLog]:
    """Collect the warnings of this thread while the context lasts.

    Parameters
    ----------
    strict : bool
        Whether the first warning about the log raises an error.

    Raises
    ------
    StrictError
        From the call that gives the warning, if `strict`.
    """
    warning_log = WarningLog()
    thread = threading.get_ident()

    class Gather(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            if record.thread != thread or not getattr(record, "is_counted", True):
                return
            warning_log.add(record)
            # Warnings without a kind are about this machine, not about the log. Parameters without effect may
            # stand in a file that serves other commands, too.
            if strict and getattr(record, "kind", NOT_OF_LOG) != NOT_OF_LOG:
                text = f"{record.getMessage()} (an error because of strict=True)"
                where = {name: getattr(record, name, None) for name in FIELDS[1:]}
                raise StrictError(text, **where)

    logger, handler = logging.getLogger(PACKAGE), Gather(logging.WARNING)
    # Placed before the handlers that print: a warning that becomes an error is printed only as the error.
    logger.handlers.insert(0, handler)
    try:
        yield warning_log
    finally:
        logger.removeHandler(handler)
