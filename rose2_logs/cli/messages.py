"""Messages on stderr: errors and warnings as lines for people, or as JSON objects for programs."""

from __future__ import annotations

import logging
import sys
from collections import Counter
from dataclasses import dataclass
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.text import Text

from rose2_logs.cli.flags import with_flags
from rose2_logs.errors import Rose2LogsError
from rose2_logs.system.warnings import FIELDS, PACKAGE

SHOWN_OF_KIND = 3
"""Warnings of one kind that are shown; a log with a thousand damaged messages has a thousand more."""
STYLES = {"info": "cyan", "warning": "yellow", "error": "bold red"}

errors = Console(stderr=True, highlight=False, emoji=False)
"""Where messages and progress go."""


@dataclass
class MessageStyle:
    """Which messages are shown, and how.

    Attributes
    ----------
    level : int
        The least, of the `logging` module.
    as_json : bool
        Whether each is one line of JSON.
    debug : bool
        Whether errors are shown with their tracebacks.
    """

    level: int = logging.WARNING
    as_json: bool = False
    debug: bool = False

    @property
    def shows_progress(self) -> bool:
        """Whether bars are drawn: for people who look on."""
        return errors.is_terminal and not self.as_json and self.level <= logging.WARNING


style = MessageStyle()


def show_messages(*, quiet: bool = False, verbose: bool = False, as_json: bool = False) -> None:
    """Show the messages of this package from now on.

    Parameters
    ----------
    quiet : bool
        Only errors.
    verbose : bool
        Also what is done, and every warning; it wins over `quiet`.
    as_json : bool
        Each as one line of JSON: time, level, message, kind, file, topic, index.
    """
    style.level = logging.INFO if verbose else logging.ERROR if quiet else logging.WARNING
    style.as_json = as_json
    logger = logging.getLogger(PACKAGE)
    logger.handlers = [_MessageHandler(style.level)]
    logger.setLevel(min(style.level, logging.WARNING))
    logger.propagate = False


class _MessageHandler(logging.Handler):
    """Shows messages through the console of the progress bar, so that they do not break it."""

    def __init__(self, level: int) -> None:
        super().__init__(level)
        self._shown: Counter[str] = Counter()

    def emit(self, record: logging.LogRecord) -> None:
        """Show one message; if its kind came often, only say so."""
        fields = {name: getattr(record, name, None) for name in FIELDS}
        kind = fields["kind"]
        if kind is not None and not style.as_json and style.level >= logging.WARNING:
            self._shown[kind] += 1
            if self._shown[kind] == SHOWN_OF_KIND + 1:
                show("warning", f"more of this kind ({kind}) are only counted; --verbose shows them")
            if self._shown[kind] > SHOWN_OF_KIND:
                return
        show(record.levelname.lower(), record.getMessage(), **fields)


def show(level: str, message: str, **fields: Any) -> None:
    """Show one line; the further fields go into JSON only."""
    text = printable(with_flags(message))
    if style.as_json:
        import json
        from datetime import UTC, datetime

        now = datetime.now(UTC).isoformat(timespec="milliseconds")
        entry = {"time": now, "level": level, "message": text} | {name: fields.get(name) for name in FIELDS}
        errors.file.write(json.dumps(entry | fields) + "\n")
        errors.file.flush()
    else:
        errors.print(f"[{STYLES.get(level, 'default')}]{level}:[/] {escape(text)}", soft_wrap=True)


def printable(text: str) -> str:
    """Return a text as one line without control characters, which names in a log may hold."""
    return "".join(sign if sign.isprintable() else "\ufffd" for sign in " ".join(text.split()))


def error(message: str, **fields: Any) -> None:
    """Show one line about an error, after the traceback of the one being handled if that was requested."""
    if style.debug and sys.exc_info()[0] is not None:
        import traceback

        if style.as_json:
            fields["traceback"] = traceback.format_exc()
        else:
            errors.print(escape(traceback.format_exc()), soft_wrap=True)
    show("error", message, **fields)


def show_error(failure: Rose2LogsError) -> None:
    """Show one line about a known error, with what it concerns for programs."""
    error(str(failure), file=failure.file, topic=failure.topic, index=failure.index)


def warning(message: str) -> None:
    """Show one line about what is not as it should be, unless only errors are shown."""
    if style.level <= logging.WARNING:
        show("warning", message)


def progress_line(markup: str) -> None:
    """Show a line with markup about how the work goes on, unless only errors are shown."""
    if style.level > logging.WARNING:
        return
    if style.as_json:
        show("info", Text.from_markup(markup).plain)
    else:
        errors.print(markup, soft_wrap=True)
