"""A batch that is run again: what stands, what is done again, what needs leave. The work is done here."""

from __future__ import annotations

import dataclasses
import errno
import json
import shutil
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from batches import Heard, WorkersHere, summary, tree
from rosbags import rosbag2
from saved_maps import save_run

from rose2_logs.batch import driver, task
from rose2_logs.batch.driver import BatchResult, run_batch
from rose2_logs.batch.folders import LOGS_FOLDER, REPLACED, WORK_FOLDER, put_in_place
from rose2_logs.batch.options import BatchOptions
from rose2_logs.batch.record import RECORD
from rose2_logs.config.parameters import Parameters
from rose2_logs.config.run_options import RECORDING_LAYERS, RunOptions
from rose2_logs.errors import LogError, OutputError, ParameterError

QUIET = RunOptions(recording=False, annotated_log=False)


class Batches:
    """Two logs, ``one/run`` and ``two/run``, and a folder for results."""

    def __init__(self, folder: Path) -> None:
        self.logs, self.out = folder / "logs", folder / "out"
        save_run(self.logs / "one" / "run", (115, 240))
        save_run(self.logs / "two" / "run", (150, 240))
        self.heard = Heard()

    def run(self, *logs: str, settings: RunOptions = QUIET, **options: object) -> dict[str, str]:
        """Run a batch over these folders of logs, or all; return what became of each log."""
        self.heard = Heard()
        self.result: BatchResult = run_batch(
            [str(self.logs / log) for log in logs or ("",)],
            self.out,
            BatchOptions(settings, **options),  # type: ignore[arg-type]
            self.heard,
        )
        return {state.name: state.status for state in self.result.states}

    def change(self, log: str) -> None:
        """Make another log of it."""
        shutil.rmtree(self.logs / log)
        save_run(self.logs / log, (120, 180, 240))

    def snapshots(self, name: str) -> int:
        """Number of snapshots in the data set."""
        path = self.out / "tables" / "snapshots" / f"log={name}" / "snapshots.parquet"
        return pq.read_metadata(path).num_rows


@pytest.fixture
def batches(tmp_path: Path, monkeypatch) -> Batches:
    monkeypatch.setattr(driver, "LocalWorkers", WorkersHere)
    monkeypatch.setattr(task, "RETRY_PAUSE_S", 0.0)
    batches = Batches(tmp_path)
    assert batches.run() == {"one_run": "done", "two_run": "done"}
    return batches


def test_progress_is_told(batches):
    """Of the whole and of each log."""
    assert batches.heard.begun == (2, 0)
    assert sorted(batches.heard.ended) == ["one_run", "two_run"]
    assert all(shares[0] == 0.0 and shares == sorted(shares) for shares in batches.heard.shares.values())


def test_finished_logs_are_left_as_they_are(batches):
    """Every file of theirs; first by their contents, for they are too new to be trusted by their looks."""
    before = {
        path: path.stat().st_mtime_ns for path in batches.out.rglob("*.parquet") if "logs" in path.parts
    }
    assert batches.run() == {"one_run": "up to date", "two_run": "up to date"}
    assert batches.heard.begun == (2, 0)
    assert {path: path.stat().st_mtime_ns for path in before} == before


def test_logs_that_look_the_same_are_not_even_opened(batches):
    """Once their files are older than the grain of time stamps."""
    for record in batches.out.glob(f"{LOGS_FOLDER}/*/{RECORD}"):
        record.write_text(record.read_text().replace('"is_sound": false', '"is_sound": true'))
    assert batches.run() == {"one_run": "up to date", "two_run": "up to date"}
    assert batches.heard.begun == (2, 2)
    assert not batches.heard.shares


def test_new_logs_join(batches):
    """Named as if they had been there from the first."""
    save_run(batches.logs / "three" / "run", (130, 240))
    assert batches.run() == {"one_run": "up to date", "two_run": "up to date", "three_run": "done"}
    assert set(summary(batches.out)) == {"one_run", "two_run", "three_run"}


def test_a_log_that_has_changed_needs_leave_to_be_replaced(batches):
    """Its results stand until then, and so do its rows in the data set."""
    batches.change("two/run")
    assert batches.run() == {"one_run": "up to date", "two_run": "failed"}
    assert "has changed since its results; overwrite=True" in summary(batches.out)["two_run"]["reason"]
    assert batches.snapshots("two_run") == 2
    assert batches.run(overwrite=True) == {"one_run": "up to date", "two_run": "done"}
    assert batches.snapshots("two_run") == 3


def test_a_log_that_cannot_be_replaced_keeps_its_results(batches):
    """Though it was to be."""
    for described in (batches.logs / "two" / "run").glob("*.yaml"):
        described.write_text("resolution: 0")
    assert batches.run(overwrite=True) == {"one_run": "up to date", "two_run": "failed"}
    assert batches.snapshots("two_run") == 2
    assert (batches.out / "logs" / "two_run" / "summary.json").exists()


def test_other_settings_need_leave_too_and_nothing_is_begun_without(batches, caplog):
    """A data set of two kinds of results would be a trap."""
    before = tree(batches.out)
    other = RunOptions(
        parameters=Parameters().replaced({"tracking": {"match_min_iou": 0.3}}),
        recording=False,
        annotated_log=False,
    )
    with pytest.raises(OutputError, match=r"match_min_iou 0\.2, now 0\.3.*overwrite=True"):
        batches.run("one", settings=other)
    assert tree(batches.out) == before
    assert batches.run("one", settings=other, overwrite=True) == {"one_run": "done"}
    assert "1 logs that are not among those given now keep results of other options" in caplog.text
    assert batches.run(settings=other, overwrite=True) == {"one_run": "up to date", "two_run": "done"}


def test_rerun_does_everything_again(batches):
    """Also what is up to date."""
    before = {path: path.stat().st_mtime_ns for path in batches.out.glob("tables/*/*/*.parquet")}
    assert batches.run(rerun=True) == {"one_run": "done", "two_run": "done"}
    assert all(path.stat().st_mtime_ns != before[path] for path in before)


def test_results_that_lack_a_file_are_made_again(batches):
    """As when a recording is wanted after all, or a table was removed; no leave is needed."""
    assert batches.run("one", settings=RunOptions(annotated_log=False)) == {"one_run": "done"}
    assert (batches.out / "logs" / "one_run" / "run.rrd").exists()
    assert batches.run("one") == {"one_run": "up to date"}
    (batches.out / "logs" / "one_run" / "rooms.parquet").unlink()
    assert batches.run("one") == {"one_run": "done"}


def test_a_recording_of_other_layers_is_made_again(batches):
    """Only where it is asked for; what was written before is remembered."""
    plain, full = (RunOptions(annotated_log=False, layers=layers) for layers in ((), RECORDING_LAYERS))
    recording = batches.out / "logs" / "one_run" / "run.rrd"
    assert batches.run("one", settings=plain) == {"one_run": "done"}
    small = recording.stat().st_size
    assert batches.run("one", settings=plain) == {"one_run": "up to date"}
    assert batches.run("one") == {"one_run": "up to date"}
    assert batches.run("one", settings=full) == {"one_run": "done"}
    assert recording.stat().st_size > small


def test_each_folder_becomes_a_bag(batches):
    """Of results that stand without a description, too."""
    described = [batches.out / "logs" / name / "metadata.yaml" for name in ("one_run", "two_run")]
    settings = RunOptions(recording=False, bag=True)
    assert batches.run("one", settings=dataclasses.replace(settings, bag=False)) == {"one_run": "done"}
    assert not described[0].exists()
    assert batches.run(settings=settings) == {"one_run": "done", "two_run": "done"}
    for path in described:
        with rosbag2.Reader(path.parent) as bag:
            assert "/rose2/rooms" in bag.topics


def test_what_is_to_be_back_projected_joins_the_data_set(batches):
    """Of results that stand without it, too; it stays until a log is analyzed without it."""
    partition = batches.out / "tables" / "back_projected" / "log=one_run"
    back_projected = RunOptions(recording=False, annotated_log=False, back_project=True)
    plain = dataclasses.replace(back_projected, back_project=False)
    assert not partition.exists()
    assert batches.run("one", settings=back_projected) == {"one_run": "done"}
    assert batches.run("one", settings=back_projected) == {"one_run": "up to date"}
    kept = (batches.out / "logs" / "one_run" / "back_projected.parquet").read_bytes()
    assert (partition / "back_projected.parquet").read_bytes() == kept
    assert [each.name for each in partition.parent.iterdir()] == ["log=one_run"]
    assert batches.run("one", settings=plain) == {"one_run": "up to date"}
    assert partition.exists()
    assert batches.run("one", settings=plain, rerun=True) == {"one_run": "done"}
    assert not partition.exists()


def test_strict_makes_a_warning_about_a_log_its_failure(batches):
    """The other logs are analyzed."""
    described = batches.logs / "two" / "run" / "map1.yaml"
    described.write_text(described.read_text().replace("resolution: 0.05", "resolution: 0"))
    settings = dataclasses.replace(QUIET, strict=True)
    assert batches.run(settings=settings, rerun=True) == {"one_run": "done", "two_run": "failed"}
    assert "an error because of strict=True" in summary(batches.out)["two_run"]["reason"]


def test_a_log_that_moved_is_known_by_its_content(batches):
    """Another log of its name and size is not taken for it."""
    (batches.logs / "one").rename(batches.logs / "elsewhere")
    assert batches.run("elsewhere") == {"one_run": "up to date"}
    kept = json.loads((batches.out / "logs" / "one_run" / RECORD).read_text())
    assert kept["address"] == str(batches.logs / "elsewhere" / "run")
    shutil.copytree(batches.logs / "elsewhere", batches.logs / "like it")
    described = batches.logs / "like it" / "run" / "map0.yaml"
    described.write_text(described.read_text().replace("[1.0, 2.0", "[3.0, 4.0"))
    assert batches.run("like it") == {"run": "done"}
    assert set(summary(batches.out)) == {"one_run", "two_run", "run"}


def test_logs_whose_results_were_removed_leave_the_data_set(batches):
    """Folder by folder a user can take logs out again."""
    shutil.rmtree(batches.out / "logs" / "two_run")
    batches.run("one")
    assert set(summary(batches.out)) == {"one_run"}
    assert not list(batches.out.glob("tables/*/log=two_run"))


def test_folders_that_are_not_of_a_batch_are_left_alone(batches):
    """As those that analyze made there."""
    foreign = batches.out / "logs" / "run"
    shutil.copytree(batches.out / "logs" / "one_run", foreign)
    (foreign / RECORD).unlink()
    save_run(batches.logs / "three" / "run", (130, 240))
    assert batches.run("three") == {"three_run": "done"}
    assert set(summary(batches.out)) == {"one_run", "two_run", "three_run"}


def test_a_batch_killed_between_two_renames_gets_its_results_back(batches):
    """Earlier results are whole wherever they lie."""
    aside = batches.out / WORK_FOLDER / REPLACED
    aside.mkdir()
    (batches.out / "logs" / "one_run").rename(aside / "one_run")
    assert batches.run("two") == {"two_run": "up to date"}
    assert set(summary(batches.out)) == {"one_run", "two_run"}
    assert not list(aside.iterdir())


def test_results_that_cannot_be_put_in_place_leave_the_earlier_ones(batches, tmp_path):
    """As when the disk fails."""
    with pytest.raises(OSError, match="nowhere"):
        put_in_place(tmp_path / "nowhere", batches.out, "one_run")
    assert (batches.out / "logs" / "one_run" / "summary.json").exists()


def fails(times: int, error: OSError, monkeypatch) -> list[int]:
    """Let the first calls of what reads a log fail; return a list that grows with each call."""
    from rose2_logs.workflows import analyze as run

    calls: list[int] = []
    whole = run.analyze_log

    def analyze(path, *arguments):
        calls.append(len(calls))
        if len(calls) <= times:
            raise LogError(f"{path}: cannot be read: {error.strerror}") from error
        return whole(path, *arguments)

    monkeypatch.setattr(run, "analyze_log", analyze)
    return calls


@pytest.mark.parametrize("failures", [1, 2, 3])
def test_a_fault_of_the_storage_is_tried_again(batches, monkeypatch, failures: int):
    """As often as --retries says."""
    calls = fails(failures, OSError(errno.EIO, "Input/output error"), monkeypatch)
    became = batches.run("one", rerun=True, retries=2)
    assert became == {"one_run": "done" if failures <= 2 else "failed"}
    assert len(calls) == min(failures, 2) + 1
    assert [name for name, _ in batches.heard.retries] == ["one_run"] * min(failures, 2)
    assert not (batches.out / WORK_FOLDER / "unfinished").exists()


def test_what_no_try_will_mend_is_not_tried_again(batches, monkeypatch):
    """A missing permission, a bad log."""
    calls = fails(9, PermissionError(errno.EACCES, "Permission denied"), monkeypatch)
    assert batches.run("one", rerun=True, retries=2) == {"one_run": "failed"}
    assert len(calls) == 1


def test_a_log_that_changes_while_it_is_read_fails(batches, monkeypatch):
    """Its results would be of no log at all; the earlier ones stand."""
    from rose2_logs.workflows import analyze as run

    whole = run.analyze_log

    def analyze(path, *arguments):
        result = whole(path, *arguments)
        (path / "map9.yaml").write_text("image: map1.png")
        return result

    monkeypatch.setattr(run, "analyze_log", analyze)
    assert batches.run("one", rerun=True) == {"one_run": "failed"}
    assert "changed while it was read" in summary(batches.out)["one_run"]["reason"]
    assert batches.snapshots("one_run") == 2


@pytest.mark.parametrize("url", ["https://host/results", "file:///results"])
def test_results_go_to_a_folder_or_a_store(batches, url: str):
    """Another URL for results is refused, not taken for a folder's name."""
    batches.out = Path(url)
    with pytest.raises(ParameterError, match="to a folder or to an object store"):
        batches.run()
