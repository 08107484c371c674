"""Open a recording in Rerun's viewer without a screen and save what it shows as PNGs.

Needs a Vulkan driver; Debian's ``mesa-vulkan-drivers`` draws in software.

    python tools/screenshot_recording.py results/office/office.rrd office.png --coverage 1.0
    python tools/screenshot_recording.py results/office/office.rrd walls.png --tab Walls --view
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rerun.experimental import ViewerClient

PORT = 9899
LOAD_TIMEOUT_S = 60.0
SETTLE_S = 1.0
"""Between two pictures that have to be the same before one is taken for drawn."""
DRAW_TIMEOUT_S = 60.0
"""Longest wait for a picture: a busy machine that draws in software may take many seconds."""
OF_THE_MACHINE = ("rasterizer", "Docker", "containerized", "Failed to render screenshot")
"""Words of warnings that are about the machine, how busy it is too, not about the recording."""


@dataclass(frozen=True)
class Shot:
    """One picture.

    Attributes
    ----------
    picture : path
        The PNG to write.
    coverage : float
        Where along the run, 0 to 1.
    log_time_s : float, optional
        Where along the time of the log instead, seconds since 1970.
    snapshot : int, optional
        At which map instead.
    tabs : tuple of str
        Names of views to bring to the front.
    is_view : bool
        Whether to show the first of them alone instead of the whole window.
    """

    picture: Path
    coverage: float = 1.0
    tabs: tuple[str, ...] = ()
    is_view: bool = False
    log_time_s: float | None = None
    snapshot: int | None = None


def take(recording: Path, shots: Sequence[Shot], port: int = PORT, settle_s: float = SETTLE_S) -> list[str]:
    """Take pictures of a recording and return what the viewer finds wrong with it.

    Raises
    ------
    RuntimeError
        If the recording does not load, or a tab is not there.
    """
    # The viewer is looked for on the path, where an environment that is not activated does not stand.
    os.environ["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}"
    problems: list[str] = []
    with ViewerClient.spawn(headless=True, port=port, detach_process=False) as viewer:
        viewer.open(str(recording.resolve()))
        _wait_until_loaded(viewer)
        for shot in shots:
            views = _bring_to_front(viewer, shot.tabs)
            if shot.log_time_s is not None:
                viewer.set_time("message_log_time", timestamp=shot.log_time_s, play_state="paused")
            elif shot.snapshot is not None:
                viewer.set_time("snapshot", sequence=shot.snapshot, play_state="paused")
            else:
                place = round(100 * shot.coverage)
                viewer.set_time("coverage_percent", sequence=place, play_state="paused")
            shot.picture.write_bytes(_drawn(viewer, views[0] if shot.is_view else None, settle_s))
            problems += _reports(viewer)
        problems += [
            f"{entry.level}: {entry.message}"
            for entry in viewer.get_logs()
            if any(level in entry.level.upper() for level in ("WARN", "ERROR"))
            and not any(word in entry.message for word in OF_THE_MACHINE)
        ]
    return problems


def _wait_until_loaded(viewer: ViewerClient) -> None:
    end = time.monotonic() + LOAD_TIMEOUT_S
    while time.monotonic() < end:
        state = viewer.get_state()
        if state.views and not state.loading:
            return
        time.sleep(0.5)
    raise RuntimeError(f"the recording did not load within {LOAD_TIMEOUT_S:.0f} s")


def _drawn(viewer: ViewerClient, view: str | None, settle_s: float) -> bytes:
    """Take a picture as soon as it does not change any more.

    A view whose tab has just come to the front is not there until the viewer has drawn once.
    """
    end = time.monotonic() + DRAW_TIMEOUT_S
    before = b""
    while True:
        time.sleep(settle_s)
        try:
            now = viewer.take_screenshot(view)
        except Exception as error:
            # What the client raises depends on its version.
            if time.monotonic() > end:
                raise RuntimeError(f"no picture within {DRAW_TIMEOUT_S:.0f} s: {error}") from error
            continue
        if now == before or (before and time.monotonic() > end):
            return now
        before = now


def _bring_to_front(viewer: ViewerClient, names: Sequence[str]) -> list[str]:
    """Make each of some views the active one of its tabs; return their ids."""
    if not names:
        return []
    ids = {view.name: str(view.view_id) for view in viewer.get_state().views}
    if missing := [name for name in names if name not in ids]:
        raise RuntimeError(f"the recording has no view {missing[0]!r}")
    chosen = [ids[name] for name in names]
    blueprint: dict[str, Any] = viewer.get_blueprint(of="recording").blueprint
    for parts in blueprint.values():
        container = parts.get("ContainerBlueprint", {})
        for view in chosen:
            if f"view/{view}" in container.get("contents", []):
                container["active_tab"] = f"view/{view}"
    viewer.set_blueprint(blueprint, of="recording")
    return chosen


def _reports(viewer: ViewerClient) -> list[str]:
    return [f"{view.name}: {report}" for view in viewer.get_state().views for report in view.reports]


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("recording", type=Path, help="the .rrd file")
    parser.add_argument("picture", type=Path, help="the PNG to write")
    parser.add_argument("--coverage", type=float, default=1.0, help="where along the run, 0 to 1 (default 1)")
    parser.add_argument(
        "--time", type=float, metavar="S", help="where along the log's time instead, seconds since 1970"
    )
    parser.add_argument("--snapshot", type=int, metavar="N", help="at which map instead")
    parser.add_argument("--tab", action="append", default=[], help="name of a view to bring to the front")
    parser.add_argument("--view", action="store_true", help="the first of these alone, not the whole window")
    arguments = parser.parse_args()
    place = {"log_time_s": arguments.time, "snapshot": arguments.snapshot}
    shot = Shot(arguments.picture, arguments.coverage, tuple(arguments.tab), arguments.view, **place)
    if arguments.view and not arguments.tab:
        parser.error("--view needs --tab")
    problems = take(arguments.recording, [shot])
    if problems:
        print(f"{arguments.recording}: the viewer reports: {problems}", file=sys.stderr)
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
