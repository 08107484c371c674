"""Programs that people open results with, run on a screen of their own."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from commands import started, wait_for

PROGRAMS = Path(os.environ["ROSE2_LOGS_PROGRAMS"]) if os.environ.get("ROSE2_LOGS_PROGRAMS") else None
"""Folder of what `.ci/look` installs beside the system's own programs; None elsewhere than there."""
SCREEN_PX = (1600, 900)


def needed(*names: str) -> list[str]:
    """Return the paths of programs; the test is skipped where one is absent."""
    paths = []
    for name in names:
        path = shutil.which(name)
        if path is None:
            pytest.skip(f"needs {name}, which .ci/look installs where this machine can have it")
        paths.append(path)
    return paths


def installed(name: str) -> Path:
    """Return what `.ci/look` has put into its folder; the test is skipped where it is absent."""
    path = PROGRAMS / name if PROGRAMS else None
    if path is None or not path.exists():
        pytest.skip(f"needs {name}, which .ci/look installs where this machine can have it")
    return path


@contextmanager
def screen(size_px: tuple[int, int] = SCREEN_PX) -> Iterator[dict[str, str]]:
    """Start an X server without a monitor; give the environment for programs that draw on it."""
    (server,) = needed("Xvfb")
    read, write = os.pipe()
    command = (
        server,
        "-displayfd",
        str(write),
        "-screen",
        "0",
        "{}x{}x24".format(*size_px),
        "-nolisten",
        "tcp",
    )
    with started(*command, pass_fds=(write,)), os.fdopen(read) as told:
        os.close(write)
        display = wait_for(told.readline).strip()
        yield {**os.environ, "DISPLAY": f":{display}", "LIBGL_ALWAYS_SOFTWARE": "1", "QT_X11_NO_MITSHM": "1"}


def screenshot(environment: dict[str, str], picture: Path) -> Path:
    """Write what a screen shows as a PNG."""
    (take,) = needed("import")
    subprocess.run([take, "-window", "root", picture], env=environment, check=True)
    return picture
