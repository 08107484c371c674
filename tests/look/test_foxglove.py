"""Foxglove Studio 1.48, whose code is in a package, in Chromium with the layout that is beside the log."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from urllib.parse import urlencode

import pytest
from colors import shares_of_hues
from commands import WAIT_S, wait_for
from looking import CHROMIUM, needs_chromium
from mcap.reader import make_reader
from programs import installed
from rosbags.highlevel import AnyReader

WINDOW_PX = (1600, 900)
FLAGS = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox"]
ALL_PLACES = re.compile(r"bytes=(\d+)-(\d*)")


class _Places(SimpleHTTPRequestHandler):
    """Serves files of several folders, also in parts, as Studio reads logs."""

    def __init__(self, *given, places: dict[str, Path], **options) -> None:
        self.places = places
        super().__init__(*given, **options)

    def translate_path(self, path: str) -> str:
        place, _, rest = path.partition("?")[0].strip("/").partition("/")
        return str(self.places.get(place, Path("/nowhere")) / rest)

    def do_GET(self) -> None:
        part = ALL_PLACES.match(self.headers.get("Range", ""))
        path = Path(self.translate_path(self.path))
        if part is None or not path.is_file():
            return super().do_GET()
        data = path.read_bytes()
        first, last = int(part[1]), int(part[2] or len(data) - 1)
        self.send_response(206)
        self.send_header("Content-Range", f"bytes {first}-{last}/{len(data)}")
        self.send_header("Content-Length", str(len(data[first : last + 1])))
        self.end_headers()
        self.wfile.write(data[first : last + 1])
        return None

    def end_headers(self) -> None:
        self.send_header("Accept-Ranges", "bytes")
        super().end_headers()

    def log_message(self, *_) -> None:
        """Say nothing."""


@contextmanager
def served(**places: Path) -> Iterator[str]:
    """Serve folders to programs of this machine; gives the address."""
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(_Places, places=places)) as server:
        thread = Thread(target=server.serve_forever)
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_port}"
        finally:
            server.shutdown()
            thread.join()


@contextmanager
def studio_showing(folder: Path) -> Iterator:
    """Studio at the end of an annotated log; gives the page and what went wrong in it."""
    from playwright.sync_api import sync_playwright

    studio = installed("studio")
    (log,), (layout,) = folder.glob("*.rose2.mcap"), folder.glob("*.foxglove.json")
    with log.open("rb") as file:
        end_ns = make_reader(file).get_summary().statistics.message_end_time
    time = datetime.fromtimestamp(end_ns / 1e9, UTC).isoformat().replace("+00:00", "Z")
    asked = urlencode({"layout": f"/run/{layout.name}", "log": f"/run/{log.name}", "time": time})
    with (
        served(studio=studio / "node_modules", run=folder, here=Path(__file__).parent) as address,
        sync_playwright() as playwright,
    ):
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        page = browser.new_page(viewport=dict(zip(("width", "height"), WINDOW_PX, strict=True)))
        page.set_default_timeout(WAIT_S * 1000)
        faults: list[str] = []
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.goto(f"{address}/here/studio.html?{asked}")
        yield page, faults
        browser.close()


@needs_chromium
def test_studio_shows_all_rooms_and_both_curves(wing, pictures):
    """With the layout as it is, at the end of the log: each room in its color, within the panel."""
    (log,) = wing.glob("*.rose2.mcap")
    with AnyReader([log]) as reader:
        connections = [each for each in reader.connections if each.topic == "/rose2/markers"]
        *_, (connection, _, data) = reader.messages(connections)
        markers = reader.deserialize(data, connection.msgtype).markers
    colors = [(room.color.r, room.color.g, room.color.b) for room in markers if room.ns == "rooms"]
    picture = pictures / "foxglove_wing.png"
    with studio_showing(wing) as (page, faults):

        def shown() -> bool:
            page.screenshot(path=picture)
            page.wait_for_timeout(1000)
            return bool((shares_of_hues(picture, colors) > 1e-4).all())

        try:
            wait_for(shown, WAIT_S)
        except AssertionError:
            pytest.fail(f"not all colors of rooms are in {picture}; {json.dumps(faults[:3])}")
        text = page.inner_text("body")
    assert "Number of rooms" in text
    assert not faults
