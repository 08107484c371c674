"""The report opened in Chromium as a person would: it shows, sorts, fetches nothing and fits a phone."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from finished_runs import SAMPLE_LOGS, renamed_topic, run_of
from looking import CHROMIUM, needs_chromium

from rose2_logs.outputs.report.page import write_report

pytestmark = needs_chromium
PHONE = {"width": 390, "height": 844}
DESKTOP = {"width": 1280, "height": 900}
TOPIC = "/<script>document.title='taken over'</script>"


@pytest.fixture(scope="module")
def report(tmp_path_factory) -> Path:
    """A report whose log and topic are named like programs."""
    folder = tmp_path_factory.mktemp("browser")
    log = renamed_topic(SAMPLE_LOGS / "office.mcap", TOPIC, folder / "<i>office.mcap")
    return write_report(run_of(log, folder / "out", 4, topic=TOPIC, back_project=True))


@pytest.fixture(scope="module")
def browser() -> Iterator:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as running:
        # A container's root may not use Chromium's sandbox; the page is our own.
        started = running.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield started
        started.close()


@pytest.fixture(params=[DESKTOP, PHONE], ids=["desktop", "phone"])
def page(request, browser, report: Path) -> Iterator:
    """The opened report; at the end nothing was fetched and nothing complained."""
    context = browser.new_context(viewport=request.param)
    opened = context.new_page()
    complaints, fetched = [], []
    opened.on("console", lambda message: complaints.append(message.text))
    opened.on("pageerror", lambda error: complaints.append(str(error)))
    opened.on("dialog", lambda dialog: complaints.append(dialog.message))
    opened.on("request", lambda asked: fetched.append(asked.url))
    opened.goto(report.as_uri())
    yield opened
    context.close()
    assert complaints == []
    assert [url for url in fetched if not url.startswith("data:")] == [report.as_uri()]


def column(page, table: str, number: int) -> list[str]:
    return page.locator(f"#{table} tbody tr td:nth-child({number})").all_inner_texts()


def test_everything_is_there(page):
    """Title, figures, pictures, curves, tables; names of logs are shown as they are."""
    assert page.title() == "Rooms of out"
    assert page.locator("header").get_by_text(f"{TOPIC} in frame map").is_visible()
    assert page.locator(".plan svg").is_visible()
    assert page.locator(".plan svg").get_by_text("Room 1", exact=True).count() == 1
    assert page.locator(".panels figure").count() == 4
    assert page.locator(".charts .over-coverage svg").first.is_visible()
    assert page.locator("#seen svg").is_visible()
    told = page.locator("#seen svg path title").all_text_contents()
    assert [text.partition(":")[0] for text in told] == column(page, "seen-table", 1)
    boxes = [each.bounding_box() for each in page.locator(".panels svg").all()]
    assert all(box["width"] > 100 and box["height"] > 40 for box in boxes)
    assert len(column(page, "rooms-table", 1)) > 5


def test_a_heading_sorts(page):
    """By number, not by text; again the other way; by keyboard too; missing values stay last."""
    areas = [float(text) for text in column(page, "rooms-table", 4)]
    assert areas != sorted(areas)
    heading = page.locator("#rooms-table th").nth(3)
    heading.get_by_role("button").click()
    assert [float(text) for text in column(page, "rooms-table", 4)] == sorted(areas)
    assert heading.get_attribute("aria-sort") == "ascending"
    heading.get_by_role("button").press("Enter")
    assert [float(text) for text in column(page, "rooms-table", 4)] == sorted(areas, reverse=True)
    assert heading.get_attribute("aria-sort") == "descending"
    page.locator("#rooms-table th").nth(0).get_by_role("button").click()
    numbers = [int(text.removeprefix("Room ")) for text in column(page, "rooms-table", 1)]
    assert numbers == sorted(numbers)
    assert heading.get_attribute("aria-sort") == "none"
    overlap = page.locator("#events-table th").nth(6).get_by_role("button")
    for _ in range(2):
        overlap.click()
        is_missing = [text == "–" for text in column(page, "events-table", 7)]
        assert is_missing == sorted(is_missing)


def test_curves_go_over_time_too(page):
    page.get_by_role("radio", name="over time").check()
    assert page.locator(".charts .over-time svg").first.is_visible()
    assert not page.locator(".charts .over-coverage svg").first.is_visible()


def test_nothing_sticks_out(page):
    """The page is as wide as the screen; wide tables scroll by themselves."""
    wide, screen = page.evaluate("[document.documentElement.scrollWidth, window.innerWidth]")
    assert wide <= screen
    page.locator("summary").first.click()
    assert page.evaluate("document.documentElement.scrollWidth") <= screen


def test_parameters_unfold_on_paper(page):
    assert not page.locator("#parameters-table").is_visible()
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    page.emulate_media(media="print")
    assert page.locator("#parameters-table").is_visible()
    assert not page.locator("nav").is_visible()
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    page.emulate_media(media="screen")
    assert not page.locator("#parameters-table").is_visible()
