"""The report says what was found, escapes what logs are called, and needs nothing but itself."""

from __future__ import annotations

import html
import json
import re
import shutil
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from finished_runs import SAMPLE_LOGS, renamed_topic, run_of

from rose2_logs.drawing.map_painter import UNSURE_COLOR
from rose2_logs.errors import LogError, OutputError
from rose2_logs.outputs.report import tables
from rose2_logs.outputs.report.overview import write_reports
from rose2_logs.outputs.report.page import along_coverage, write_report
from rose2_logs.outputs.report.words import css, date_of, duration
from rose2_logs.system.text import percent


class Reader(HTMLParser):
    """Texts of the cells of each table's body, tags by name, addresses."""

    def __init__(self, page: Path) -> None:
        super().__init__()
        self.tables: dict[str, list[list[str]]] = {}
        self.tags: list[str] = []
        self.addresses: list[str] = []
        self._table, self._in_cell = "", False
        self.feed(page.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attrs):
        about = dict(attrs)
        self.tags.append(tag)
        self.addresses += [value for name, value in attrs if name in ("src", "href", "srcset", "action")]
        if tag == "table":
            self._table = about["id"]
            self.tables[self._table] = []
        elif tag == "tr":
            self.tables[self._table].append([])
        elif tag == "td":
            self._in_cell = True
            self.tables[self._table][-1].append("")

    def handle_endtag(self, tag):
        if tag == "td":
            self._in_cell = False

    def handle_data(self, data):
        if self._in_cell:
            self.tables[self._table][-1][-1] += data

    def rows(self, table: str) -> list[list[str]]:
        return [row for row in self.tables[table] if row]


def test_it_says_what_the_tables_say(office_results: Path, tmp_path: Path):
    """Every track with its figures, every doorway of the last map, every event but mere going on."""
    page = write_report(office_results, tmp_path / "page.html")
    told = Reader(page)
    tracks = pq.read_table(office_results / "tracks.parquet").to_pylist()
    by_name = {row[0]: row for row in told.rows("rooms-table")}
    assert len(by_name) == len(tracks)
    for track in tracks:
        row = by_name[f"Room {track['track']}"]
        assert row[1] == (track["kind_guess"] or "–")
        assert row[2] == ("yes" if track["in_last_map"] else "no")
        assert row[3:5] == [f"{track['area_m2']:.1f}", f"{track['predicted_area_m2']:.1f}"]
        assert row[8] == f"{track['first_coverage']:.0%}"
    doorways = pq.read_table(office_results / "doorways.parquet").to_pylist()
    assert len(told.rows("doorways-table")) == len([door for door in doorways if door["snapshot"] == 5])
    events = pq.read_table(office_results / "events.parquet").to_pylist()
    assert len(told.rows("events-table")) == len([event for event in events if event["kind"] != "continued"])
    text = page.read_text(encoding="utf-8")
    summary = json.loads((office_results / "summary.json").read_text())
    assert f"<strong>{summary['results']['rooms_last']}</strong>" in text
    assert "All parameters have their defaults" in text
    parameters = {row[0]: row[1] for row in told.rows("parameters-table")}
    assert parameters["floor_plan.room_min_area_m2"] == "3"


def test_it_says_when_each_room_was_seen_where_the_run_was_back_projected(
    office_results: Path, tmp_path: Path
):
    """First, and 90 % of it, in that order; without back projection there is no such section."""
    assert "seen-table" not in Reader(write_report(office_results, tmp_path / "plain.html")).tables
    folder = run_of(SAMPLE_LOGS / "office.mcap", tmp_path / "out", annotated_log=False, back_project=True)
    told = Reader(write_report(folder)).rows("seen-table")
    back_projected = pd.read_parquet(folder / "back_projected.parquet")
    coverage = pd.read_parquet(folder / "snapshots.parquet").set_index("snapshot").coverage
    assert {row[0] for row in told} == {f"Room {track}" for track in back_projected.track.unique()}
    for row in told:
        of_room = back_projected[back_projected.track == int(row[0].removeprefix("Room "))].sort_values(
            "snapshot"
        )
        mostly = of_room[of_room.last_area_share >= 0.9]
        assert row[2] == f"{coverage[of_room.snapshot.iloc[0]]:.0%}"
        assert row[4] == (f"{coverage[mostly.snapshot.iloc[0]]:.0%}" if len(mostly) else "–")
    first = [int(row[2].removesuffix("%")) for row in told]
    assert first == sorted(first)
    assert len(set(first)) > 2
    (folder / "back_projected.parquet").unlink()
    assert "seen-table" not in Reader(write_report(folder, overwrite=True)).tables


def test_lanes_tell_when_each_room_was_right(office_results: Path, tmp_path: Path):
    """A room of the last map has settled by then; one that was right later than it came formed before.

    One that the last map does not show is only told to have been there.
    """
    text = write_report(office_results, tmp_path / "report.html").read_text(encoding="utf-8")
    tracks = pq.read_table(office_results / "tracks.parquet").to_pylist()
    signs = {row["track"]: "?" if row["wall_support"] < 0.7 else "" for row in tracks}
    for row in tracks:
        name = f"{row['track']}{signs[row['track']]}"
        if not row["in_last_map"]:
            assert f"<title>{name}: not in the last map</title>" in text
            assert f"<title>{name}: settled</title>" not in text
            continue
        assert f"<title>{name}: settled</title>" in text
        right = min(row["shape_right_snapshot"], row["area_settled_snapshot"])
        assert (f"<title>{name}: forming</title>" in text) == (right > row["first_snapshot"])


def test_a_room_that_is_gone_in_the_end_never_settled(office_results: Path, tmp_path: Path):
    """The columns that compare with the last map say nothing of it; its lane is gray."""
    folder = shutil.copytree(office_results, tmp_path / "office")
    tracks = pq.read_table(folder / "tracks.parquet")
    gone = tracks["track"].to_pylist()[-1]
    in_last = [track != gone for track in tracks["track"].to_pylist()]
    place = tracks.schema.get_field_index("in_last_map")
    pq.write_table(tracks.set_column(place, tracks.field(place), [in_last]), folder / "tracks.parquet")
    page = write_report(folder)
    rows = {row[0]: row for row in Reader(page).rows("rooms-table")}
    assert rows[f"Room {gone}"][10:13] == ["–"] * 3
    assert all("–" not in row[10:13] for name, row in rows.items() if name != f"Room {gone}")
    titles = set(re.findall(rf"<title>{gone}\??: ([a-z ]+)</title>", page.read_text(encoding="utf-8")))
    assert titles == {"not in the last map"}


def test_curves_mark_a_final_layout_only_where_its_tile_tells_of_one(office_results: Path, tmp_path: Path):
    """If only the last map is like the last map, the layout is still changing."""
    folder = shutil.copytree(office_results, tmp_path / "office")
    summary = json.loads((folder / "summary.json").read_text())
    rows = pq.read_table(folder / "snapshots.parquet").to_pylist()
    for row, is_final in ((rows[-1], False), (rows[-2], True)):
        since = {name: row[name] for name in ("snapshot", "time_s", "coverage")}
        summary["layout"]["final_since"] = since
        (folder / "summary.json").write_text(json.dumps(summary))
        text = write_report(folder, overwrite=True).read_text(encoding="utf-8")
        assert ("layout final from here on" in text) == is_final
        assert ("<strong>still changing</strong>" in text) != is_final


def test_it_stands_alone(office_results: Path, tmp_path: Path):
    """Nothing is fetched: addresses are data, places in the page, or files beside it."""
    page = write_report(office_results, tmp_path / "page.html")
    told = Reader(page)
    assert all(address.startswith(("data:", "#")) for address in told.addresses)
    assert not re.search(
        r"@import|url\(|https?://(?!www\.w3\.org/(?:2000/svg|1999/xlink)\b)", page.read_text(encoding="utf-8")
    )
    beside = shutil.copytree(office_results, tmp_path / "office")
    names = [link for link in Reader(write_report(beside)).addresses if not link.startswith(("data:", "#"))]
    assert "rooms.parquet" in names
    assert all((beside / name).is_file() for name in names)


def test_panels_are_as_many_as_asked_for(office_results: Path, tmp_path: Path):
    """And the same results give the same bytes."""
    few = write_report(office_results, tmp_path / "few.html", panels=2)
    assert Reader(few).tags.count("figcaption") == 2 + 7
    again = write_report(office_results, tmp_path / "again.html", panels=2)
    assert few.read_bytes() == again.read_bytes()


def test_names_are_text_and_never_markup(tmp_path: Path):
    """Topic, file and folder are what people call them, also where that is a program."""
    evil = "<script>alert('x')</script>&\"<img src=x onerror=alert(1)>"
    log = renamed_topic(SAMPLE_LOGS / "office.mcap", f"/{evil}", tmp_path / "<b>log & 'run'.mcap")
    folder = run_of(log, tmp_path / "<script>alert(2)<%2F", 2, topic=f"/{evil}")
    page = write_report(folder)
    text, told = page.read_text(encoding="utf-8"), Reader(page)
    assert (
        html.escape(f"/{evil} in frame map", quote=True).replace("&quot;", "&#34;").replace("&#x27;", "&#39;")
        in text
    )
    assert told.tags.count("script") == 1
    assert "img" not in told.tags
    assert "b" not in told.tags
    assert "<script>alert" not in text


def test_borders_that_may_be_read_otherwise_are_listed_and_marked(office_results: Path, tmp_path: Path):
    """Those of the last map that are unsure, the least sure one first; a page without any has no list."""
    folder = shutil.copytree(office_results, tmp_path / "office")
    borders = pq.read_table(folder / "borders.parquet").to_pandas()
    doors = pq.read_table(folder / "doorways.parquet").to_pandas().query("snapshot == 5")
    pairs = [(row.track_a, row.track_b) for row in doors.drop_duplicates(["track_a", "track_b"]).itertuples()]
    schema = pq.read_schema(folder / "borders.parquet")

    def page_with(strengths: dict[tuple[int, int], float]) -> Path:
        changed = borders.copy()
        keys = zip(changed["track_a"], changed["track_b"], strict=True)
        changed["strength"] = [strengths.get(pair, 1.0) for pair in keys]
        table = pa.Table.from_pandas(changed, schema, preserve_index=False)
        pq.write_table(table, folder / "borders.parquet")
        return write_report(folder, overwrite=True)

    told = Reader(page := page_with({pairs[0]: 0.75, pairs[1]: 0.305}))
    names = [tuple(f"Room {track}" for track in pair) for pair in pairs]
    rows = told.rows("borders-table")
    assert [tuple(row[:2]) for row in rows] == [names[1], names[0]]
    assert [row[4] for row in rows] == [percent(0.305), percent(0.75)]
    text = page.read_text(encoding="utf-8")
    purple = css(UNSURE_COLOR)
    assert "unsure border" in text
    assert purple in text
    text = page_with({}).read_text(encoding="utf-8")
    assert "borders-table" not in text
    assert purple not in text


def test_an_earlier_page_stays_unless_it_may_be_replaced(office_results: Path, tmp_path: Path):
    page = tmp_path / "page.html"
    page.write_text("mine")
    with pytest.raises(OutputError, match="overwrite=True"):
        write_report(office_results, page)
    assert page.read_text() == "mine"
    write_report(office_results, page, overwrite=True)
    assert page.read_text() != "mine"


def test_a_page_may_be_written_to_a_folder(office_results: Path, tmp_path: Path):
    assert write_report(office_results, tmp_path) == tmp_path / "report.html"
    assert (tmp_path / "report.html").exists()


def test_long_tables_are_cut_and_say_so(office_results: Path, tmp_path: Path, monkeypatch):
    """What is kept: rooms of the last map, the events that tell most."""
    monkeypatch.setattr(tables, "ROWS_MOST", 4)
    page = write_report(office_results, tmp_path / "page.html")
    told = Reader(page)
    assert [len(told.rows(name)) for name in ("rooms-table", "doorways-table", "events-table")] == [4, 4, 4]
    assert {row[2] for row in told.rows("rooms-table")} == {"yes"}
    kinds = {row["kind"] for row in pq.read_table(office_results / "events.parquet").to_pylist()}
    if "split" in kinds:
        assert "split" in {row[4] for row in told.rows("events-table")}
    assert "4 of " in page.read_text(encoding="utf-8")


def test_a_baseline_without_the_annotated_log_has_a_report(tmp_path: Path):
    """With its maps, which are stored with every run."""
    folder = run_of(
        SAMPLE_LOGS / "office.mcap", tmp_path / "out", 3, method="morphological", annotated_log=False
    )
    text = write_report(folder).read_text(encoding="utf-8")
    assert "<image" in text
    assert "morphological" in text


def test_one_map_has_a_report(tmp_path: Path):
    """There is no growth to be told then."""
    page = write_report(run_of(SAMPLE_LOGS / "wing.bag", tmp_path / "out", 1))
    assert Reader(page).rows("rooms-table")
    assert "Curves" not in page.read_text(encoding="utf-8")


def test_many_logs_have_a_page_that_lists_them(office_results: Path, tmp_path: Path):
    """With a picture of each; results that cannot be read are told and do not stop the others."""
    for name in ("logs/a", "logs/b", "logs/damaged"):
        shutil.copytree(office_results, tmp_path / name)
    (tmp_path / "logs" / "damaged" / "tracks.parquet").write_bytes(b"PAR1")
    written = write_reports(tmp_path, panels=1)
    assert written.pages == (
        tmp_path / "logs" / "a" / "report.html",
        tmp_path / "logs" / "b" / "report.html",
        tmp_path / "report.html",
    )
    (error,) = written.failed
    assert "tracks.parquet" in str(error)
    told = Reader(tmp_path / "report.html")
    assert [row[0] for row in told.rows("logs-table")] == ["a", "b"]
    links = [link for link in told.addresses if not link.startswith("data:")]
    pages = ["logs/a/report.html", "logs/b/report.html"]
    assert links == [*pages, "logs/b/report.comparison.html", *pages]
    ((name, rooms, *shares, changed),) = told.rows("building-1")
    assert (name, changed) == ("b", f"{rooms} same")
    assert all(float(share.rstrip("%")) > 99 for share in shares)
    assert f"<strong>{rooms} and {rooms}</strong>" in (tmp_path / links[2]).read_text(encoding="utf-8")
    assert told.tags.count("img") == 2
    elsewhere = write_reports(tmp_path, tmp_path / "elsewhere", panels=1).pages
    assert [page.relative_to(tmp_path).as_posix() for page in elsewhere] == [
        "elsewhere/logs/a.html",
        "elsewhere/logs/b.html",
        "elsewhere/report.html",
    ]


def test_the_page_of_a_batch_names_the_logs_that_failed(office_results: Path, tmp_path: Path):
    """As text, with the reason; a layout that was final in the last map only is not told as final."""
    shutil.copytree(office_results, tmp_path / "logs" / "a")
    summary = json.loads((office_results / "summary.json").read_text())
    rows = pq.read_table(office_results / "snapshots.parquet").to_pylist()
    summary["layout"]["final_since"] = {"snapshot": rows[-1]["snapshot"], "time_s": 1.0, "coverage": 1.0}
    (tmp_path / "logs" / "a" / "summary.json").write_text(json.dumps(summary))
    table = "log,status,reason\na,done,\nbad,failed,<b>no</b> map\n"
    (tmp_path / "summary.csv").write_text(table, encoding="utf-8")
    told = Reader(write_reports(tmp_path, panels=1).pages[-1])
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "<strong>bad</strong>: &lt;b&gt;no&lt;/b&gt; map" in text
    (row,) = told.rows("logs-table")
    assert row[7] == "–"


def test_a_folder_without_results_is_named(tmp_path: Path):
    with pytest.raises(LogError, match=r"holds no summary\.json"):
        write_reports(tmp_path)
    with pytest.raises(LogError, match="no such folder"):
        write_reports(tmp_path / "nowhere")


@pytest.mark.parametrize("most", [1, 2, 5, 12, 100])
def test_panels_stand_evenly_along_coverage(most: int):
    """First and last are there, none twice, and no stretch of coverage is left out."""
    coverage = np.concatenate([np.linspace(0.1, 0.9, 30), np.full(30, 0.9), [0.85], np.linspace(0.9, 1, 5)])
    places = along_coverage(coverage, most)
    assert len(places) == min(most, len(coverage))
    assert places == sorted(set(places))
    assert places[-1] == len(coverage) - 1
    if most > 1:
        assert places[0] == 0
        # A step of the maps themselves is 0.05 at most.
        assert np.diff(coverage[places]).max() <= 0.9 / (most - 1) + 0.05


def test_the_last_panel_is_the_only_one_of_full_coverage_that_is_needed():
    """Where some maps before the last cover as much, the first map is not given up for one of them."""
    coverage = np.concatenate([np.linspace(0.1, 1.0, 40), np.ones(10)])
    places = along_coverage(coverage, 10)
    assert (places[0], len(places)) == (0, 10)
    assert (coverage[places] == 1.0).sum() == 1


def test_maps_that_cover_the_same_are_spread():
    assert along_coverage(np.ones(101), 5) == [0, 25, 50, 75, 100]


def test_words():
    assert [duration(seconds) for seconds in (0.0, 2.5, 61.0, 7260.0)] == [
        "0 s",
        "2.5 s",
        "1 min 1 s",
        "2 h 1 min",
    ]
    assert date_of(1_700_000_020_000_000_000) == "2023-11-14 22:13:40 UTC"
    assert date_of(125_000_000_000) is None
