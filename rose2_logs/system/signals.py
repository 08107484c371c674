"""What stops a program: Ctrl-C, a service manager's or a user's TERM, the HUP of a terminal that closes."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

STOPPING = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
"""Signals upon which a program removes what is unfinished and ends."""
QUIET = STOPPING[1:]
"""Those that Python does not turn into `KeyboardInterrupt` by itself."""


@contextmanager
def heeded() -> Iterator[list[int]]:
    """Let all of `STOPPING` interrupt the context as Ctrl-C does.

    A signal that is ignored from outside, as HUP under ``nohup``, stays so; others are for the first one
    only: what is being removed then is removed to the end.

    Yields
    ------
    list of int
        Receives the signal that came, unless it was Ctrl-C.
    """
    came: list[int] = []
    if threading.current_thread() is not threading.main_thread():
        yield came
        return

    def interrupt(number: int, _: Any) -> None:
        came.append(number)
        for each in before:
            signal.signal(each, signal.SIG_IGN)
        raise KeyboardInterrupt

    before = {each: handler for each in QUIET if (handler := signal.getsignal(each)) == signal.SIG_DFL}
    for each in before:
        signal.signal(each, interrupt)
    try:
        yield came
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)


@contextmanager
def held_back() -> Iterator[None]:
    """Let a signal of `STOPPING` that comes while the context lasts take effect after it."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []
    before = {each: handler for each in STOPPING if callable(handler := signal.getsignal(each))}
    for each in before:
        signal.signal(each, lambda number, _: came.append(number))
    try:
        yield
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)
        if came:
            signal.raise_signal(came[0])


def ignore() -> None:
    """Leave stopping to the process that started this one, which ends it."""
    for each in STOPPING:
        signal.signal(each, signal.SIG_IGN)
