"""Logs behind URLs, from a real HTTP server."""

from __future__ import annotations

import json
import shutil
import sys
import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
from batches import Heard, WorkersHere, summary, table_bytes
from saved_maps import save_run

from rose2_logs.batch import driver, remote, task
from rose2_logs.batch.driver import run_batch
from rose2_logs.batch.finding import find_logs
from rose2_logs.batch.location import Location
from rose2_logs.batch.options import BatchOptions
from rose2_logs.batch.record import signature_of
from rose2_logs.config.run_options import RunOptions
from rose2_logs.errors import LogError

PROJECT = Path(__file__).parents[2]
SETTINGS = RunOptions(recording=False, annotated_log=False, max_snapshots=2, method="morphological")


class Handler(SimpleHTTPRequestHandler):
    """Serves files; counts what is fetched, and cuts answers short where a test says so."""

    fetched: list[str]
    cut: dict[str, int]

    def do_GET(self) -> None:
        self.fetched.append(self.path)
        super().do_GET()

    def copyfile(self, source, outputfile) -> None:
        if self.cut.get(self.path, 0) > 0:
            self.cut[self.path] -= 1
            outputfile.write(source.read(100))
        else:
            super().copyfile(source, outputfile)

    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture
def server(tmp_path):
    """Folder of a server with three logs, its URL, and its handler."""
    folder = tmp_path / "served"
    (folder / "r1").mkdir(parents=True)
    shutil.copy(PROJECT / "sample_logs" / "office.mcap", folder / "r1" / "first run.mcap")
    shutil.copytree(PROJECT / "sample_logs" / "ring", folder / "r2" / "ring")
    (folder / "r2" / "notes.txt").touch()
    handler = type("OwnHandler", (Handler,), {"fetched": [], "cut": {}})
    http = ThreadingHTTPServer(("127.0.0.1", 0), partial(handler, directory=folder))
    threading.Thread(target=http.serve_forever, args=(0.02,), daemon=True).start()
    yield folder, f"http://127.0.0.1:{http.server_port}", handler
    http.shutdown()
    http.server_close()


@pytest.fixture
def here(monkeypatch) -> None:
    monkeypatch.setattr(driver, "LocalWorkers", WorkersHere)
    monkeypatch.setattr(task, "RETRY_PAUSE_S", 0.0)


def found(*urls: str) -> list[str]:
    return [log.target for log in find_logs(urls, Path("results"))]


def test_folders_and_patterns_behind_urls(server):
    """As on the disk: a ROS 2 bag is one log, other files are none."""
    _, url, _ = server
    both = [f"{url}/r1/first%20run.mcap", f"{url}/r2/ring"]
    assert found(url) == both
    assert found(f"{url}/") == both
    assert found(f"{url}/*/*") == both
    assert found(f"{url}/r1/*.mcap") == both[:1]
    assert found(f"{url}/r2/ring/*.db3") == both[1:]
    assert found(*both, url) == both


@pytest.mark.parametrize("where", ["/empty", "/r1/*.bag", "/nowhere/"])
def test_nothing_there_is_one_line(server, where: str):
    """Before any work is done."""
    folder, url, _ = server
    (folder / "empty").mkdir()
    with pytest.raises(LogError, match=url):
        found(f"{url}{where}")


@pytest.mark.usefixtures("here")
def test_a_batch_over_http_writes_what_one_over_files_writes(server, tmp_path):
    """The summaries tell the URL; logs that their server calls unchanged are not even fetched again."""
    folder, url, handler = server
    out, options = tmp_path / "out", BatchOptions(SETTINGS)
    result = run_batch([url], out, options, Heard())
    assert {state.name: state.status for state in result.states} == {"first_run": "done", "ring": "done"}
    assert summary(out)["first_run"]["source"] == f"{url}/r1/first%20run.mcap"
    assert json.loads((out / "logs" / "ring" / "summary.json").read_text())["log"] == f"{url}/r2/ring"
    run_batch([str(folder)], tmp_path / "local", options, Heard())
    for name in ("first_run", "ring"):
        assert table_bytes(out / "logs" / name) == table_bytes(tmp_path / "local" / "logs" / name)

    handler.fetched.clear()
    again = run_batch([url], out, options, Heard())
    assert {state.status for state in again.states} == {"up to date"}
    assert not [path for path in handler.fetched if path.endswith((".mcap", ".db3"))]


@pytest.mark.usefixtures("here")
def test_a_signed_url_leaves_no_secret_behind(server, tmp_path):
    """Neither in names nor in files; signed anew it is the same log."""
    _, url, _ = server
    out, signed = tmp_path / "out", f"{url}/r1/first%20run.mcap?X-Amz-Signature="
    gone = signed.replace("first", "no")
    result = run_batch([f"{signed}5ecret", f"{gone}5ecret"], out, BatchOptions(SETTINGS), Heard())
    assert {state.name: state.status for state in result.states} == {"first_run": "done", "no_run": "failed"}
    files = [path for path in out.rglob("*") if path.is_file()]
    assert not [path for path in files if b"5ecret" in path.read_bytes() or "5ecret" in str(path)]
    again = run_batch([f"{signed}other"], out, BatchOptions(SETTINGS), Heard())
    assert {state.name: state.status for state in again.states} == {"first_run": "up to date"}


@pytest.mark.usefixtures("here")
def test_an_answer_that_was_cut_short_is_asked_for_again(server, tmp_path):
    """And nothing is made of the part."""
    _, url, handler = server
    handler.cut["/r1/first%20run.mcap"] = 1
    heard = Heard()
    result = run_batch([f"{url}/r1"], tmp_path / "out", BatchOptions(SETTINGS), heard)
    assert [name for name, _ in heard.retries] == ["first_run"]
    assert not result.failed


@pytest.mark.usefixtures("here")
def test_a_log_that_is_not_there_is_not_asked_for_again(server, tmp_path):
    """Its reason names the URL, not a copy's place."""
    folder, url, _ = server
    (folder / "r1" / "bad.mcap").write_bytes(b"\x89MCAP0\r\n")
    heard, out = Heard(), tmp_path / "out"
    result = run_batch([f"{url}/r1/bad.mcap", f"{url}/nowhere.bag"], out, BatchOptions(SETTINGS), heard)
    assert {state.name for state in result.failed} == {"bad", "nowhere"}
    assert heard.retries == []
    reasons = {state.name: state.row["reason"] for state in result.states}
    assert reasons["nowhere"] == f"{url}/nowhere.bag: there is no such file or folder"
    assert reasons["bad"].startswith(f"{url}/r1/bad.mcap: ")


def test_a_server_that_does_not_answer_is_a_fault_that_may_pass(server):
    """Unlike a file that is not there."""
    with pytest.raises(remote.TransferError):
        signature_of(Location("http://127.0.0.1:9/run.mcap"))
    assert not issubclass(LogError, remote.TransferError)


def test_names_from_a_server_do_not_lead_out_of_the_folder(tmp_path):
    """They are those of somebody else."""
    for name in ("../run.mcap", "/etc/run.mcap", "a/../../run.mcap", "a\\run.mcap", ""):
        with pytest.raises(LogError, match="cannot be that of a local file"):
            remote._local_name("memory://x", name)
    with pytest.raises(LogError, match="cannot be that of a local file"):
        remote._local_name("http://x", "..%2Frun.mcap")
    assert remote._local_name("http://x", "a/first%20run.mcap") == "a/first run.mcap"


def test_logs_inside_an_archive(tmp_path):
    """Any of fsspec's file systems will do, also one in another."""
    save_run(tmp_path / "in" / "maps")
    archive = shutil.make_archive(str(tmp_path / "logs"), "zip", tmp_path / "in")
    (url,) = found(f"zip://::{archive}")
    assert url == f"zip://maps::{archive}"
    copy = remote.fetch(url, remote.describe(url), tmp_path / "copy")
    assert copy == tmp_path / "copy" / "maps"
    names = sorted(path.name for path in (tmp_path / "in" / "maps").iterdir())
    assert sorted(path.name for path in copy.iterdir()) == names


def test_without_the_extra_a_url_says_what_to_install(monkeypatch):
    """In one line; so does a kind of URL whose own library is not there."""
    monkeypatch.setitem(sys.modules, "gcsfs", None)
    with pytest.raises(LogError, match="gcsfs"):
        found("gs://bucket/run*.mcap")
    monkeypatch.setitem(sys.modules, "fsspec.core", None)
    with pytest.raises(LogError, match=r"pip install 'rose2-logs\[batch\]'"):
        found("http://host/run*.mcap")
    with pytest.raises(LogError, match=r"pip install 'rose2-logs\[batch\]'"):
        found("http://host/run.mcap")
