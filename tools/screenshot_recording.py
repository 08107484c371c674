"""Open a recording in Rerun's viewer without a screen and save what it shows as a PNG.

Needs a Vulkan driver; Debian's ``mesa-vulkan-drivers`` draws in software.

    python tools/screenshot_recording.py results/office/office.rrd office.png --coverage 1.0
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path
from typing import Any

from rerun.experimental import ViewerClient

from rose2_logs.sinks.rerun_blueprint import COVERAGE_UNIT

PORT = 9899
LOAD_TIMEOUT_S = 60.0
SETTLE_S = 2.0
"""Time for the views to draw after the cursor has moved."""


def screenshot(recording: Path, picture: Path, coverage: float = 1.0, port: int = PORT) -> None:
    """Save the viewer's picture of a recording at a coverage.

    Raises
    ------
    RuntimeError
        If a view reports an error, or the recording does not load.
    """
    # The viewer is looked for on the path, where an environment that is not activated does not stand.
    os.environ["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}"
    with ViewerClient.spawn(headless=True, port=port, detach_process=False) as viewer:
        viewer.open(str(recording.resolve()))
        _wait_until_loaded(viewer)
        viewer.set_time("coverage", sequence=round(coverage / COVERAGE_UNIT), play_state="paused")
        time.sleep(SETTLE_S)
        problems = _reports(viewer)
        picture.write_bytes(viewer.take_screenshot())
    if problems:
        raise RuntimeError(f"{recording}: the viewer reports: {problems}")


def _wait_until_loaded(viewer: ViewerClient) -> None:
    end = time.monotonic() + LOAD_TIMEOUT_S
    while time.monotonic() < end:
        state: Any = viewer.get_state()
        if getattr(state, "views", None):
            return
        time.sleep(0.5)
    raise RuntimeError(f"the recording did not load within {LOAD_TIMEOUT_S:.0f} s")


def _reports(viewer: ViewerClient) -> list[str]:
    state: Any = viewer.get_state()
    return [str(report) for view in state.views for report in getattr(view, "reports", [])]


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("recording", type=Path, help="the .rrd file")
    parser.add_argument("picture", type=Path, help="the PNG to write")
    parser.add_argument("--coverage", type=float, default=1.0, help="where along the run, 0 to 1 (default 1)")
    arguments = parser.parse_args()
    screenshot(arguments.recording, arguments.picture, arguments.coverage)
    return 0


if __name__ == "__main__":
    sys.exit(main())
