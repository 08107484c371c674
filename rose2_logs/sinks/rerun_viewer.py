"""A Rerun viewer on this machine: found or started."""

from __future__ import annotations

import socket
import subprocess
import sys
import time

from rose2_logs.errors import OutputError

VIEWER_PORT = 9876
"""Where Rerun's viewer listens unless told otherwise."""
VIEWER_START_S, VIEWER_SETTLE_S = 30.0, 1.0


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
    command = [sys.executable, "-m", "rerun", "--bind", "127.0.0.1", "--port", str(port)]
    viewer = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )
    end = time.monotonic() + VIEWER_START_S
    while time.monotonic() < end and viewer.poll() is None:
        if listens(port):
            # A viewer without a screen listens for a moment before it ends.
            time.sleep(VIEWER_SETTLE_S)
            if viewer.poll() is None:
                return address
        time.sleep(0.1)
    raise OutputError("no Rerun viewer is open and none can be started here; leave --live out")


def listens(port: int) -> bool:
    """Whether something on this machine answers at a port."""
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0
