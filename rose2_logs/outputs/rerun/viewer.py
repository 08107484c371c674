"""A Rerun viewer on this machine: found or started, in a window or in the browser."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO
from urllib.parse import quote

from rose2_logs.errors import LogError, OutputError

VIEWER_PORT = 9876
"""Where Rerun's viewer listens by default."""
VIEWER_START_S, VIEWER_SETTLE_S = 120.0, 1.0
"""Longest wait for a viewer, which starts within seconds unless the machine is busy; time for it to fail."""
PAGE_PORT = 9090
"""Where Rerun serves its web viewer by default."""
SERVER_MEMORY = "50%"
SCREENS = ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET")
"""Environment variables that are set where there is a screen."""
RERUN = (sys.executable, "-m", "rerun", "--bind", "127.0.0.1")
"""Rerun's servers answer the whole network by default."""


def open_viewer(port: int) -> str:
    """Start a viewer, for this machine only, unless one is open; return its address.

    Raises
    ------
    OutputError
        If there is none and none can be started.
    """
    address = f"rerun+http://127.0.0.1:{port}/proxy"
    if listens(port):
        return address
    command, nowhere = [*RERUN, "--port", str(port)], subprocess.DEVNULL
    viewer = subprocess.Popen(command, stdout=nowhere, stderr=nowhere, start_new_session=True)
    end = time.monotonic() + VIEWER_START_S
    while time.monotonic() < end and viewer.poll() is None:
        if listens(port):
            # A viewer without a screen listens for a moment before it ends.
            time.sleep(VIEWER_SETTLE_S)
            if viewer.poll() is None:
                return address
        time.sleep(0.1)
    _end(viewer)
    raise OutputError("no Rerun viewer is open and none can be started here; leave out live=True")


def listens(port: int) -> bool:
    """Whether something on this machine answers at a port."""
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


def has_screen() -> bool:
    """Whether a window can be opened here; where there is always a screen, there is."""
    return sys.platform != "linux" or any(os.environ.get(name) for name in SCREENS)


def find_recording(named: Path | str) -> str:
    """Return a recording, the only one in a folder, or an address as it is.

    Raises
    ------
    LogError
        If there is none, or there are several.
    """
    if "://" in str(named):
        return str(named)
    path = Path(named)
    if path.is_file():
        return str(path)
    if not path.is_dir():
        raise LogError(f"{path}: there is no such file; an analysis writes a recording (.rrd)")
    found = sorted(path.glob("*.rrd"))
    if not found:
        below = min(path.rglob("*.rrd"), default=None)
        hint = f"; did you mean {below.parent}?" if below else ""
        raise LogError(f"{path}: holds no recording{hint}")
    if len(found) > 1:
        raise LogError(f"{path}: holds several recordings; name one, or serve the folder to show all")
    return str(found[0])


def show(recording: str) -> int:
    """Open a recording, or an address, in a window and wait until it is closed; return the exit code.

    Raises
    ------
    OutputError
        If there is no screen.
    """
    if not has_screen():
        raise OutputError("there is no screen here for a window; show it in a browser (web=True)")
    return subprocess.run([*RERUN, recording], check=False).returncode


@contextmanager
def served_page(recording: str, port: int | None = None) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """Serve the web viewer with a recording, or with what an address serves, to this machine.

    Parameters
    ----------
    recording : str
        Path or address.
    port : int, optional
        Of the page; by default `PAGE_PORT`, or a free one where that is taken.

    Yields
    ------
    url, server
        Address of the page, which answers; and the process.

    Raises
    ------
    OutputError
        If it cannot be served.
    """
    if port is not None and listens(port):
        raise OutputError(f"port {port} is in use; choose another port")
    page, data = port or _free_port(PAGE_PORT), _free_port(VIEWER_PORT)
    options = ["--serve-web", "--web-viewer-port", str(page), "--port", str(data)]
    # The server forgets the beginning of what is larger than its memory.
    command = [*RERUN, recording, *options, "--server-memory-limit", SERVER_MEMORY]
    with tempfile.TemporaryFile() as said, _running(command, said) as server:
        end = time.monotonic() + VIEWER_START_S
        while not (listens(page) and ("://" in recording or listens(data))):
            if server.poll() is not None or time.monotonic() > end:
                said.seek(0)
                lines = said.read().decode(errors="replace").strip().splitlines()
                raise OutputError(f"the web viewer cannot be started: {lines[-1] if lines else 'it ended'}")
            time.sleep(0.1)
        source = recording if "://" in recording else f"rerun+http://127.0.0.1:{data}/proxy"
        yield f"http://127.0.0.1:{page}/?url={quote(source, safe='')}", server


@contextmanager
def _running(command: Sequence[str], said: IO[bytes]) -> Iterator[subprocess.Popen[bytes]]:
    """Run a command until the end of the block, then end it with all that it started."""
    process = subprocess.Popen(command, stdout=said, stderr=said, start_new_session=True)
    try:
        yield process
    finally:
        _end(process)


def _end(process: subprocess.Popen[bytes]) -> None:
    """End a command that was started in its own session, with all processes that it started."""
    if hasattr(os, "killpg"):
        # Rerun's command is a script that starts the viewer itself.
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGTERM)
    else:
        process.terminate()
    process.wait()


def _free_port(wished: int) -> int:
    """Return the port if nothing listens there, else a free one."""
    if not listens(wished):
        return wished
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
    return port
