"""Recordings of several runs in one catalog, asked through Rerun's own client and looked at in its viewer."""

from __future__ import annotations

import importlib.util
import re
import shutil
import signal
import socket
import sys
from pathlib import Path

import pytest
from commands import ROSE2_LOGS, WAIT_S, started, wait_for
from saved_maps import save_run

from rose2_logs.errors import LogError, OutputError
from rose2_logs.outputs.rerun.catalog import _corners_m, find_recordings, serve_recordings
from rose2_logs.workflows.analyze import RunOptions, analyze_log

BIN = Path(sys.executable).parent


@pytest.fixture(scope="module")
def results(tmp_path_factory) -> Path:
    """Two runs below a folder, as a batch writes them; one is back_projected."""
    folder = tmp_path_factory.mktemp("runs")
    for name, seen in (("first", (115, 240)), ("second", (150, 240))):
        save_run(folder / "logs" / name, seen)
        results = folder / "results" / "logs" / name
        options = RunOptions(annotated_log=False, back_project=name == "first")
        analyze_log(folder / "logs" / name, results, options)
    return folder / "results"


def test_all_runs_are_segments_of_one_data_set_in_our_layout(results):
    """Named like the folder; each with its timelines."""
    from rerun.catalog import CatalogClient

    with serve_recordings(results, "127.0.0.1", 0) as (url, count):
        assert count == 2
        assert url.startswith("rerun+http://127.0.0.1:")
        (dataset,) = CatalogClient(url).datasets()
        assert dataset.name == "results"
        assert sorted(each.rpartition("-")[0] for each in dataset.segment_ids()) == ["first", "second"]
        table = dataset.segment_table().to_pandas()
        assert list(table["coverage_percent:end"]) == [100, 100]
        assert dataset.default_blueprint() in dataset.blueprints()


def test_a_second_recording_of_a_run_is_left_out_and_told(results, tmp_path, caplog):
    """The catalog can hold one of each; the newest is taken. So are files that are no recordings left out."""
    shutil.copytree(results, tmp_path / "all")
    copy = tmp_path / "all" / "logs" / "first" / "copy.rrd"
    shutil.copyfile(copy.with_name("first.rrd"), copy)
    copy.with_name("broken.rrd").write_bytes(b"RRF2")
    copy.with_name(".first.rrd.part.rrd").touch()
    found = [path.name for path in find_recordings(tmp_path / "all")]
    assert found == ["copy.rrd", "second.rrd"]
    assert "first.rrd: is left out: it is of the same run as" in caplog.text
    assert "broken.rrd: is left out" in caplog.text
    with serve_recordings(tmp_path / "all", "127.0.0.1", 0) as (_, count):
        assert count == 2


def test_nothing_to_serve_is_one_line(tmp_path):
    """It names the folder."""
    with (
        pytest.raises(LogError, match=f"{tmp_path}: holds no recording"),
        serve_recordings(tmp_path, "127.0.0.1", 0),
    ):
        pass


def test_a_port_in_use_is_one_line(results):
    """With the port."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with (
            pytest.raises(OutputError, match=f"127.0.0.1:{port}: no server can be started"),
            serve_recordings(results, "127.0.0.1", port),
        ):
            pass


def test_without_the_catalogs_client_the_runs_are_served_all_the_same(results, monkeypatch, caplog):
    """Only the layout is missing; one line says what to install."""
    find = importlib.util.find_spec
    without = lambda name, *more: None if name == "datafusion" else find(name, *more)  # noqa: E731
    monkeypatch.setattr(importlib.util, "find_spec", without)
    with serve_recordings(results, "127.0.0.1", 0) as (_, count):
        assert count == 2
    assert "pip install 'rose2-logs[batch]'" in caplog.text


def test_the_command_serves_this_machine_alone_until_it_is_interrupted(results):
    """The line that it prints can be copied; Ctrl-C is how it ends."""
    with started(*ROSE2_LOGS, "serve", results, "--port", 0) as process:
        line = process.stdout.readline()
        url = re.fullmatch(r"2 recordings at (\S+); open them with rose2-logs view \1\n", line)[1]
        port = int(url.rpartition(":")[2])
        with socket.create_connection(("127.0.0.1", port), timeout=WAIT_S):
            pass
        with socket.socket() as other:
            # Were the server bound to all addresses, this one would be taken too.
            other.bind(("127.0.0.2", port))
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=WAIT_S)
    assert (process.returncode, err) == (0, "")


@pytest.mark.skipif(
    not list(Path("/usr/share/vulkan/icd.d").glob("lvp_icd*")),
    reason="the headless viewer needs a Vulkan driver (mesa-vulkan-drivers)",
)
def test_the_viewer_opens_a_run_of_the_catalog_in_our_layout(results, tmp_path, monkeypatch):
    """With the views of a recording that is opened alone, and no view reports an error."""
    from rerun.catalog import CatalogClient
    from rerun.experimental import ViewerClient

    monkeypatch.setenv("PATH", f"{BIN}:/usr/bin:/bin")
    monkeypatch.setenv("HOME", str(tmp_path))
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    with (
        serve_recordings(results, "127.0.0.1", 0) as (url, _),
        ViewerClient.spawn(headless=True, port=port, detach_process=False) as viewer,
    ):
        (dataset,) = CatalogClient(url).datasets()
        viewer.open(dataset.segment_url(dataset.segment_ids()[0]))
        wanted = {"Rooms", "Rooms projected back", "Room history"}
        wait_for(lambda: wanted <= {view.name for view in viewer.get_state().views})
        assert not [report for view in viewer.get_state().views for report in view.reports]


def test_damaged_results_next_to_a_recording_are_named_and_served(office_results, tmp_path, caplog):
    """Their recording is whole; only where the first view looks is not known."""
    folder = shutil.copytree(office_results, tmp_path / "damaged")
    (folder / "office.rrd").touch()
    whole = _corners_m([office_results / "office.rrd"])
    assert (_corners_m([office_results / "office.rrd", folder / "office.rrd"])[1] == whole[1]).all()
    assert not caplog.records
    (folder / "rooms.parquet").unlink()
    assert (_corners_m([office_results / "office.rrd", folder / "office.rrd"])[1] == whole[1]).all()
    (record,) = caplog.records
    assert "rooms.parquet: there is no such file" in record.getMessage()
