"""Programs that tests start: they heed Ctrl-C in whatever shell, and end with all that they start."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TypeVar

WAIT_S = float(os.environ.get("ROSE2_LOGS_WAIT_S", "180"))
"""Longest wait for what a program does within seconds on an idle machine."""
LEAVE_S = 10.0
"""Time that processes have to end by themselves after the last test."""
ROSE2_LOGS = (sys.executable, "-m", "rose2_logs")
MARK = "ROSE2_LOGS_TESTS"
"""Variable by which a process is known to come from a test."""
OF_PYTHON = ("resource_tracker", "forkserver")
"""Helpers of multiprocessing that end with the tests themselves."""

Found = TypeVar("Found")


def heed_ctrl_c() -> None:
    """Let SIGINT interrupt this process and those that it starts.

    A shell starts what it puts into the background with SIGINT ignored, and programs inherit that.
    """
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _heed_hangups() -> None:
    """Heed HUP, which what runs the tests may ignore, as under ``nohup``; a program inherits that."""
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


@contextmanager
def started(*command: object, **options: Any) -> Iterator[subprocess.Popen[str]]:
    """Start a program in a session of its own; at the end of the block it and all below it are killed."""
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen(
        [str(part) for part in command],
        text=True,
        start_new_session=True,
        preexec_fn=_heed_hangups if hasattr(signal, "SIGHUP") else None,  # noqa: PLW1509
        **(pipes | options),
    ) as process:
        try:
            yield process
        finally:
            for pid in below(process.pid):
                with suppress(OSError):
                    os.kill(pid, signal.SIGKILL)
            if sys.platform == "win32":
                process.kill()
            else:
                with suppress(OSError):
                    os.killpg(process.pid, signal.SIGKILL)


def below(pid: int) -> list[int]:
    """Processes that a process has started, and those that they have; none where there is no /proc."""
    found = []
    for tasks in Path("/proc").glob(f"{pid}/task/*/children"):
        with suppress(OSError):
            for child in map(int, tasks.read_text().split()):
                found += [child, *below(child)]
    return found


def is_running(pid: int) -> bool:
    """Whether there is a process that has not ended."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def wait_for(look: Callable[[], Found | None], seconds: float = WAIT_S) -> Found:
    """Wait until there is something to be seen."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if found := look():
            return found
        time.sleep(0.02)
    raise AssertionError(f"it did not come within {seconds:g} s")


@contextmanager
def nothing_left_behind() -> Iterator[None]:
    """Kill and tell what was started in the block and still runs after it; where there is /proc."""
    os.environ[MARK] = uuid.uuid4().hex
    mark = f"{MARK}={os.environ[MARK]}"
    yield
    with suppress(AssertionError):
        wait_for(lambda: not _marked(mark), LEAVE_S)
    left = _marked(mark)
    for pid in left:
        with suppress(OSError):
            os.kill(pid, signal.SIGKILL)
    assert not left, f"still running after the last test: {list(left.values())}"


def _marked(mark: str) -> dict[int, str]:
    """Command lines of the processes with a mark, but for this one, those it forked and Python's helpers."""
    found = {}
    for folder in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            if mark.encode() in (folder / "environ").read_bytes().split(b"\0") and is_running(
                int(folder.name)
            ):
                line = (folder / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace").strip()
                if not any(name in line for name in OF_PYTHON):
                    found[int(folder.name)] = line
    return found
