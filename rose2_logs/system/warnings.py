"""Warnings about a log, with what a program needs to know of them; gathered, counted, or taken as errors."""

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
"""Name of the logger above all those of this package."""
FIRST_KEPT = 5
"""Warnings of one kind that are kept word by word; the rest are counted."""
FIELDS = ("kind", "file", "topic", "index")
"""What a record of the log tells beside its text: see `notice`."""

UNCOUNTED = {"is_counted": False}
"""Passed as `extra` with what is said of how a run goes on, which does not belong to its results."""

_is_muted: ContextVar[bool] = ContextVar("_is_muted", default=False)


@contextmanager
def muted() -> Iterator[None]:
    """Say nothing while the context lasts: for a second look at what is told elsewhere."""
    token = _is_muted.set(True)
    try:
        yield
    finally:
        _is_muted.reset(token)


class StrictError(Rose2LogsError):
    """A warning, where warnings are errors."""


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
    """Say that something is not as it should be.

    Parameters
    ----------
    logger : Logger
        Of the module that found it.
    kind : str
        Short name of this kind of fault, which it is counted under.
    text : str
        One line for people, complete in itself.
    file : path, optional
        The log or the file of it that is concerned.
    topic : str, optional
        The topic.
    index : int, optional
        Number of the message on its topic, or of the snapshot, from 1.
    level : int
        Of the `logging` module.
    """
    if _is_muted.get():
        return
    extra = {"kind": kind, "file": None if file is None else str(file), "topic": topic, "index": index}
    logger.log(level, "%s", text, extra=extra)


@dataclass
class WarningsOfKind:
    """How often a kind of warning came, and the first few of them."""

    count: int = 0
    first: list[dict[str, Any]] = field(default_factory=list)


@dataclass
class WarningLog:
    """The warnings of a run, by kind in the order in which they first came."""

    kinds: dict[str, WarningsOfKind] = field(default_factory=dict)

    @property
    def count(self) -> int:
        """Warnings of all kinds."""
        return sum(found.count for found in self.kinds.values())

    def add(self, record: logging.LogRecord) -> None:
        """Take a warning."""
        found = self.kinds.setdefault(getattr(record, "kind", "other"), WarningsOfKind())
        found.count += 1
        if len(found.first) < FIRST_KEPT:
            told = {name: getattr(record, name, None) for name in FIELDS[1:]}
            found.first.append(
                {"message": record.getMessage()} | {k: v for k, v in told.items() if v is not None}
            )

    def rename(self, old: str, new: str) -> None:
        """Write another name for a log: of one that was copied to be read, where it comes from."""
        for found in self.kinds.values():
            for told in found.first:
                told.update({k: v.replace(old, new) for k, v in told.items() if isinstance(v, str)})

    def as_json(self) -> dict[str, Any]:
        """Return the number of warnings, and of each kind the number and the first few."""
        kinds = {kind: {"count": found.count, "first": found.first} for kind, found in self.kinds.items()}
        return {"count": self.count, "kinds": kinds}

    def texts(self) -> list[str]:
        """Return the warnings that were kept, and one line for each kind about those that were not."""
        lines = []
        for kind, found in self.kinds.items():
            lines += [told["message"] for told in found.first]
            if found.count > len(found.first):
                lines.append(f"{found.count - len(found.first)} more warnings of the kind {kind}")
        return lines


@contextmanager
def collect_warnings(strict: bool = False) -> Iterator[WarningLog]:
    """Gather the warnings that this thread gives while the context lasts.

    Parameters
    ----------
    strict : bool
        Whether the first warning ends what gives it.

    Raises
    ------
    StrictError
        Out of the call that gives a warning, if `strict`.
    """
    warning_log = WarningLog()
    thread = threading.get_ident()

    class Gather(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            if record.thread != thread or not getattr(record, "is_counted", True):
                return
            warning_log.add(record)
            # Others are about this machine, not about the log.
            if strict and hasattr(record, "kind"):
                text = f"{record.getMessage()} (an error because of strict=True)"
                where = {name: getattr(record, name, None) for name in FIELDS[1:]}
                raise StrictError(text, **where)

    logger, handler = logging.getLogger(PACKAGE), Gather(logging.WARNING)
    # Before those that show warnings: one that becomes an error is shown as the error alone.
    logger.handlers.insert(0, handler)
    try:
        yield warning_log
    finally:
        logger.removeHandler(handler)
