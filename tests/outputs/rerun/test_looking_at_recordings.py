"""Recordings as a person sees them: in Rerun's viewer, and in its web viewer in a browser.

The kept pictures are made by this module itself, run with tests/ on PYTHONPATH.
"""

from __future__ import annotations

import os
import signal
import tempfile
import time
from itertools import cycle, pairwise
from pathlib import Path

import numpy as np
from commands import ROSE2_LOGS, WAIT_S, started
from looking import CHROMIUM, colored_share, free_port, needs_chromium, needs_vulkan, small
from numpy.typing import NDArray
from PIL import Image

from rose2_logs.workflows.analyze import RunOptions, analyze_log

PROJECT = Path(__file__).parents[3]
GOLDEN = Path(__file__).with_name("golden")
COVERAGES = (0.3, 0.6, 1.0)
TABS = ("Rooms projected back", "Clean map", "Structure score", "Walls", "Faces", "Voronoi graph", "Spectrum")
PANELS = ("Area, m²", "Seen share, %", "Rooms", "Change")
LANES_TAB = "Room history"
TEXTS = ("Events", LANES_TAB, "Legend", "Summary")
FIRST_MAP_S = 1_700_000_020.0
"""Log time of the sample's first map."""
GOLDEN_WIDTH = 160
MOST_DIFFERENCE = 6.0
"""Mean difference of two pictures of the same, in steps of 256: another version draws lines otherwise."""
END_OF_CURVES, LANES = (slice(130, 400), slice(1750, 1910)), (slice(500, 1000), slice(1200, 1910))
"""Where they stand in the window: rows and columns."""
CURVES_SHARE, LANES_SHARE = 0.01, 0.3
"""Share of these that thin curves, and lanes, take at least."""
LOOK_S = 0.4
BROWSER_FLAGS = (
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
)
FROM_OUTSIDE = ("Failed to load resource", "Failed to fetch")
"""Errors about fonts and examples that the viewer looks for on the network."""


def record(folder: Path) -> Path:
    options = RunOptions(max_snapshots=8, annotated_log=False, back_project=True)
    log = PROJECT / "sample_logs" / "office.mcap"
    return analyze_log(log, folder, options).folder / "office.rrd"


def shots(folder: Path) -> dict[str, Path]:
    """Pictures of the view of rooms along the run, and of every other view; the viewer finds no fault."""
    from screenshot_recording import Shot, take

    along = {f"rooms_{100 * at:.0f}": Shot(folder / f"{at}.png", at, ("Rooms",), True) for at in COVERAGES}
    others = {
        tab: Shot(folder / f"{tab}.png", 1.0, (tab, panel, text), True)
        for tab, panel, text in zip(TABS, cycle(PANELS), cycle(TEXTS), strict=False)
    }
    over = {"over time": Shot(folder / "time.png", tabs=(LANES_TAB,), log_time_s=FIRST_MAP_S)}
    taken = along | others | over
    problems = take(record(folder), list(taken.values()), port=free_port(), settle_s=LOOK_S)
    assert not problems
    return {name: shot.picture for name, shot in taken.items()}


@needs_vulkan
def test_the_viewer_shows_the_rooms_as_it_did_and_finds_no_fault_in_any_view(tmp_path, monkeypatch):
    """At three coverages the rooms are those of the kept pictures; every view shows something."""
    monkeypatch.setenv("HOME", str(tmp_path))
    pictures = shots(tmp_path)
    for at in COVERAGES:
        name = f"rooms_{100 * at:.0f}"
        now = small(pictures[name], GOLDEN_WIDTH).astype(int)
        assert now.shape == kept(at).shape
        assert np.abs(now - kept(at)).mean() < MOST_DIFFERENCE, name
    # The map fills its view.
    assert colored_share(pictures["rooms_100"], (slice(None), slice(None))) > 0.35
    # Curves and lanes go over the whole run along the log's time, too; the curves are no stroke at the rim.
    assert colored_share(pictures["over time"], END_OF_CURVES) > CURVES_SHARE
    assert colored_share(pictures["over time"], LANES) > LANES_SHARE
    for name in TABS:
        assert np.asarray(Image.open(pictures[name]).convert("L")).std() > 5, name


def test_the_kept_pictures_can_be_told_apart():
    """By more than what two pictures of the same may differ by."""
    for one, other in pairwise(COVERAGES):
        assert np.abs(kept(one) - kept(other)).mean() > 2 * MOST_DIFFERENCE


def kept(coverage: float) -> NDArray[np.int64]:
    return np.asarray(Image.open(GOLDEN / f"rooms_{100 * coverage:.0f}.png").convert("RGB")).astype(int)


@needs_chromium
def test_the_web_viewer_draws_the_recording_without_an_error(tmp_path):
    """As the command serves it, until the rooms are there; on this machine only."""
    from playwright.sync_api import sync_playwright

    recording = record(tmp_path)
    env = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}
    faults: list[str] = []
    with started(*ROSE2_LOGS, "view", recording.parent, "--web", env=env, stderr=None) as view:
        url = view.stdout.readline().split()[0]
        assert url.startswith("http://127.0.0.1:")
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=CHROMIUM, args=BROWSER_FLAGS)
            page = browser.new_page(viewport={"width": 1000, "height": 640})
            page.on("pageerror", lambda error: faults.append(str(error)))
            page.on("console", lambda said: faults.append(said.text) if said.type == "error" else None)
            page.goto(url)
            page.wait_for_selector("canvas", timeout=1000 * WAIT_S)
            end = time.monotonic() + WAIT_S
            # The view of rooms takes the left of the page, below its bars.
            view_of_rooms = (slice(80, 600), slice(0, 650))
            picture = tmp_path / "page.png"
            while True:
                page.screenshot(path=picture)
                if colored_share(picture, view_of_rooms) > 0.3:
                    break
                assert time.monotonic() < end, "the rooms were not drawn"
                time.sleep(1)
            browser.close()
        view.send_signal(signal.SIGINT)
        view.wait(timeout=WAIT_S)
    assert not [fault for fault in faults if not any(known in fault for known in FROM_OUTSIDE)]
    assert view.returncode == 0


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        for name, picture in shots(Path(folder)).items():
            if name.startswith("rooms_"):
                Image.fromarray(small(picture, GOLDEN_WIDTH)).save(GOLDEN / f"{name}.png", optimize=True)
