"""A Rerun viewer on this machine: found or started, in a window or in the browser."""

from __future__ import annotations

import os
import secrets
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from functools import partial
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import quote

from rose2_logs.errors import LogError, OutputError
from rose2_logs.system.files import expanded, reason_of
from rose2_logs.system.guarded_port import is_welcome

VIEWER_PORT = 9876
"""Where Rerun's viewer listens by default."""
VIEWER_START_S, VIEWER_SETTLE_S = 120.0, 1.0
"""Longest wait for a viewer, which starts within seconds unless the machine is busy; time for it to fail."""
PAGE_PORT = 9090
"""Where Rerun serves its web viewer by default."""
SCREENS = ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET")
"""Environment variables that are set where there is a screen."""
RERUN = (sys.executable, "-m", "rerun", "--bind", "127.0.0.1")
"""Rerun's servers answer the whole network by default."""
MAGIC = b"RRF"
"""First bytes of a recording of any version."""


def open_viewer(port: int) -> tuple[str, subprocess.Popen[bytes] | None]:
    """Start a viewer, for this machine only, unless one is open.

    Returns
    -------
    address : str
    process : Popen or None
        The viewer, if it was started; see `end`.

    Raises
    ------
    OutputError
        If there is none and none can be started.
    """
    address = f"rerun+http://127.0.0.1:{port}/proxy"
    if listens(port):
        return address, None
    command, nowhere = [*RERUN, "--port", str(port)], subprocess.DEVNULL
    viewer = subprocess.Popen(command, stdout=nowhere, stderr=nowhere, start_new_session=True)
    try:
        latest = time.monotonic() + VIEWER_START_S
        while time.monotonic() < latest and viewer.poll() is None:
            if listens(port):
                # A viewer without a screen listens for a moment before it ends.
                time.sleep(VIEWER_SETTLE_S)
                if viewer.poll() is None:
                    return address, viewer
            time.sleep(0.1)
    except BaseException:
        end(viewer)
        raise
    end(viewer)
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
        If there is none, or there are several, or the file is no recording.
    """
    if "://" in str(named):
        return str(named)
    path = expanded(Path(named))
    if path.is_file():
        with path.open("rb") as file:
            if file.read(len(MAGIC)) != MAGIC:
                raise LogError(f"{path}: is no recording of Rerun; an analysis writes one (.rrd)")
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
    with _running([*RERUN, recording]) as viewer:
        return viewer.wait()


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
    page = port or _free_port(PAGE_PORT)
    with ExitStack() as stack:
        try:
            served = stack.enter_context(_served_at(page, recording))
        except OutputError:
            # Another viewer that starts at the same time may have taken the usual port.
            if port is not None or page != PAGE_PORT:
                raise
            served = stack.enter_context(_served_at(_free_port(), recording))
        yield served


@contextmanager
def _served_at(page: int, recording: str) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """Serve the web viewer at a port; as `served_page`."""
    origin = f"http://127.0.0.1:{page}"
    # The page takes the file itself: Rerun's own server of recordings is never idle.
    at_address = nullcontext(recording) if "://" in recording else served_file(Path(recording), origin)
    with at_address as source, tempfile.TemporaryDirectory() as folder:
        said = Path(folder) / "said"
        options = ["--serve-web", "--web-viewer-port", str(page), "--port", str(_free_port())]
        with _running([*RERUN, source, *options], said) as server:
            latest = time.monotonic() + VIEWER_START_S
            # Its own word, as something else may listen there.
            while f"{origin} " not in (text := said.read_text("utf-8", "replace")):
                if server.poll() is not None or time.monotonic() > latest:
                    told = (text.strip().splitlines() or ["it ended"])[-1]
                    raise OutputError(f"the web viewer cannot be started: {told}")
                time.sleep(0.1)
            yield f"{origin}/?url={quote(source, safe='')}", server


@contextmanager
def served_file(path: Path, origin: str) -> Iterator[str]:
    """Serve one file to the page of one origin on this machine; yield its address.

    Raises
    ------
    LogError
        If it cannot be read.
    """
    try:
        path.open("rb").close()
    except OSError as error:
        raise LogError(f"{path}: cannot be read: {reason_of(error)}") from error
    place = f"/{secrets.token_urlsafe(16)}/{quote(path.name)}"
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(_OneFile, path, place, origin)) as server:
        server.daemon_threads = True
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_port}{place}"
        finally:
            server.shutdown()


class _OneFile(BaseHTTPRequestHandler):
    """Answers requests for one file."""

    def __init__(self, path: Path, place: str, origin: str, *connection: Any) -> None:
        self._path, self._place, self._origin = path, place, origin
        super().__init__(*connection)

    def do_GET(self) -> None:
        """Send the file."""
        if not is_welcome(self.headers.get("Host")):
            self.send_error(HTTPStatus.FORBIDDEN)
        elif self.path != self._place:
            self.send_error(HTTPStatus.NOT_FOUND)
        else:
            # The page may close before the whole file is sent.
            with suppress(ConnectionError), self._path.open("rb") as file:
                self.send_response(HTTPStatus.OK)
                self.send_header("Content-Type", "application/octet-stream")
                self.send_header("Content-Length", str(os.fstat(file.fileno()).st_size))
                self.send_header("Access-Control-Allow-Origin", self._origin)
                self.end_headers()
                shutil.copyfileobj(file, self.wfile)

    def log_message(self, *_: Any) -> None:
        """Say nothing of each request."""


@contextmanager
def _running(command: Sequence[str], said: Path | None = None) -> Iterator[subprocess.Popen[bytes]]:
    """Run a command until the end of the block, then end it with all that it started.

    What it says goes to the file `said`, if given, and it says where it listens, whatever RUST_LOG is.
    """
    with said.open("wb") if said else nullcontext() as file:
        env = {**os.environ, "RUST_LOG": "info"} if said else None
        process = subprocess.Popen(command, stdout=file, stderr=file, env=env, start_new_session=True)
    try:
        yield process
    finally:
        end(process)


def end(process: subprocess.Popen[bytes]) -> None:
    """End a command that was started in its own session, with all processes that it started."""
    if hasattr(os, "killpg"):
        # Rerun's command is a script that starts the viewer itself.
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGTERM)
    else:
        process.terminate()
    process.wait()


def _free_port(wished: int = 0) -> int:
    """Return the port if nothing listens there, else a free one."""
    if wished and not listens(wished):
        return wished
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
    return port
