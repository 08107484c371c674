"""Logs in an object store: a real server that speaks S3, on this machine."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest
from batches import (
    Heard,
    WorkersHere,
    cluster_in,
    finish,
    make_logs,
    run_batch,
    started_batch,
    summary,
    table_bytes,
    tree,
    worker_of,
)
from commands import wait_for

from rose2_logs.batch import driver
from rose2_logs.batch.finding import find_logs
from rose2_logs.batch.location import Location
from rose2_logs.batch.options import BatchOptions
from rose2_logs.batch.record import signature_of
from rose2_logs.batch.remote import TransferError
from rose2_logs.config.run_options import RunOptions
from rose2_logs.errors import LogError

pytest.importorskip("s3fs")
moto_server = pytest.importorskip("moto.server")

QUIET = RunOptions(recording=False, annotated_log=False)
LOGS = {"slow", "one_run", "two_run"}


@pytest.fixture(scope="module")
def store():
    """Address of the server."""
    server = moto_server.ThreadedMotoServer("127.0.0.1", 0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    yield f"http://{host}:{port}"
    server.stop()


@pytest.fixture(autouse=True)
def access(store, monkeypatch, tmp_path):
    """What a user of a store sets, and nothing else that this machine may have set."""
    for name in [name for name in os.environ if name.startswith(("AWS_", "FSSPEC_"))]:
        monkeypatch.delenv(name)
    monkeypatch.setenv("AWS_ENDPOINT_URL", store)
    monkeypatch.setenv("AWS_ACCESS_KEY_ID", "key")
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "secret")
    monkeypatch.setenv("AWS_EC2_METADATA_DISABLED", "true")
    for name in ("AWS_CONFIG_FILE", "AWS_SHARED_CREDENTIALS_FILE"):
        monkeypatch.setenv(name, str(tmp_path / "none"))


@pytest.fixture
def bucket(tmp_path):
    """A bucket of its own for each test, with the logs of a folder beside it."""
    import s3fs

    logs, name = make_logs(tmp_path / "logs"), f"b{os.urandom(6).hex()}"
    files = s3fs.S3FileSystem(skip_instance_cache=True)
    files.mkdir(name)
    files.put(f"{logs}/", f"{name}/runs/", recursive=True)
    files.pipe(f"{name}/runs/bag/metadata.yaml", b"")
    files.pipe(f"{name}/runs/bag/bag_0.db3", b"")
    files.pipe(f"{name}/runs/notes.txt", b"")
    yield files, name, logs
    files.rm(name, recursive=True)


def found(*urls: str) -> list[str]:
    return [log.target for log in find_logs(urls, Path("results"))]


def test_folders_and_patterns_of_a_bucket(bucket):
    """As on the disk: a ROS 2 bag is one log, other files are none."""
    _, name, _ = bucket
    runs = f"s3://{name}/runs"
    every = [f"{runs}/{log}" for log in ("bag", "one/run", "slow", "two/run")]
    assert sorted(found(runs)) == sorted(found(f"s3://{name}")) == sorted(found(f"{runs}/*")) == every
    assert found(f"{runs}/*/*.db3") == every[:1]
    assert found(f"{runs}/*/run") == [every[1], every[3]]


def test_a_batch_that_is_killed_goes_on_and_ends_with_every_byte_right(bucket, tmp_path):
    """Only what was not finished is fetched again, and an object that has changed is noticed."""
    files, name, logs = bucket
    files.rm(f"{name}/runs/bag", recursive=True)
    url, out = f"s3://{name}/runs", tmp_path / "out"
    with started_batch(url, "-o", out, "--workers", 2) as process:
        wait_for(lambda: worker_of(out, "slow"))
        wait_for(lambda: list(out.glob("logs/*")))
        os.killpg(process.pid, signal.SIGKILL)
        finish(process)
    done = {path.name for path in out.glob("logs/*")}
    assert done
    assert "slow" not in done
    heard, options = Heard(), BatchOptions(QUIET, workers=1)
    result = driver.run_batch([url], out, options, heard)
    assert {state.name for state in result.states if state.status == "up to date"} == done
    assert set(heard.shares) == LOGS - done
    assert {row["source"] for row in summary(out).values()} == {
        f"{url}/{log}" for log in ("one/run", "slow", "two/run")
    }

    code, _, err = run_batch(logs, "-o", tmp_path / "local", "--workers", 2)
    assert code == 0, err
    for log in LOGS:
        assert table_bytes(out / "logs" / log) == table_bytes(tmp_path / "local" / "logs" / log)

    before = signature_of(Location(f"{url}/slow"))
    assert signature_of(Location(f"{url}/slow")).proves_unchanged_since(before)
    files.pipe(f"{name}/runs/slow/map0.yaml", files.cat(f"{name}/runs/slow/map0.yaml") + b"\n")
    assert not signature_of(Location(f"{url}/slow")).proves_unchanged_since(before)


def test_results_in_a_bucket_survive_a_kill_and_are_those_of_a_folder(bucket, tmp_path):
    """Logs and results are in one bucket; what is there whole is not made again, and nothing else is left."""
    files, name, logs = bucket
    files.rm(f"{name}/runs/bag", recursive=True)
    url, out = f"s3://{name}", f"s3://{name}/results"

    def finished() -> set[str]:
        files.invalidate_cache()
        return {path.split("/")[-2] for path in files.glob(f"{name}/results/logs/*/.batch.json")}

    with started_batch(url, "-o", out, "--workers", 2) as process:
        wait_for(finished)
        os.killpg(process.pid, signal.SIGKILL)
        finish(process)
    done = finished()
    assert done
    assert "slow" not in done
    heard, options = Heard(), BatchOptions(QUIET, workers=1)
    result = driver.run_batch([url], out, options, heard)
    assert {state.name for state in result.states if state.status == "up to date"} == done
    assert set(heard.shares) == LOGS - done
    assert result.out == out

    code, _, err = run_batch(logs, "-o", tmp_path / "out", "--workers", 2)
    assert code == 0, err
    files.invalidate_cache()
    below = {path.removeprefix(f"{name}/results/") for path in files.find(f"{name}/results")}
    assert below == {*tree(tmp_path / "out")}
    for path in below:
        if path.endswith(".parquet") and path != "summary.parquet":
            assert files.cat(f"{name}/results/{path}") == (tmp_path / "out" / path).read_bytes()
    rows = files.cat(f"{name}/results/summary.csv").decode().splitlines()
    assert [row.split(",")[:2] for row in rows[1:]] == [[log, "done"] for log in sorted(LOGS)]

    again = driver.run_batch([url], out, options, Heard())
    assert {state.status for state in again.states} == {"up to date"}
    with pytest.raises(LogError, match="there is no bucket 'nowhere'"):
        driver.run_batch([url], "s3://nowhere/results", options, Heard())


def test_workers_of_a_cluster_need_no_common_folder(bucket, tmp_path):
    """Only the store: a worker makes no folder that another process would have to see."""
    files, name, logs = bucket
    out = f"s3://{name}/results/"
    with cluster_in(tmp_path) as (file, _):
        urls = [f"s3://{name}/runs/{log}" for log in ("one/run", "two/run")]
        result = driver.run_batch(urls, out, BatchOptions(QUIET, scheduler=file), Heard())
    assert {state.name: state.status for state in result.states} == {"one_run": "done", "two_run": "done"}
    run_batch(logs / "one", logs / "two", "-o", tmp_path / "out")
    files.invalidate_cache()
    for path in (tmp_path / "out").glob("logs/*/*.parquet"):
        stored = f"{name}/results/{path.relative_to(tmp_path / 'out').as_posix()}"
        assert files.cat(stored) == path.read_bytes()


def test_results_of_a_log_that_changed_replace_the_earlier_ones(bucket, monkeypatch):
    """Also in the data set; what the new ones lack is removed, and so are tables of logs that are gone."""
    files, name, _ = bucket
    monkeypatch.setattr(driver, "LocalWorkers", WorkersHere)
    url, out = f"s3://{name}/runs/one/run", f"s3://{name}/results"
    full = RunOptions(recording=False, annotated_log=False, back_project=True)
    driver.run_batch([url], out, BatchOptions(full), Heard())
    files.pipe(f"{name}/results/tables/rooms/log=gone/rooms.parquet", b"")
    files.pipe(f"{name}/results/tables/rooms.parquet", b"of the user")
    files.rm_file(f"{name}/runs/one/run/map0.yaml")
    kept = files.cat(f"{name}/results/tables/maps/log=run/maps.parquet")
    assert driver.run_batch([url], out, BatchOptions(QUIET), Heard()).failed
    files.invalidate_cache()
    assert files.cat(f"{name}/results/tables/maps/log=run/maps.parquet") == kept
    assert not driver.run_batch([url], out, BatchOptions(QUIET, overwrite=True), Heard()).failed
    files.invalidate_cache()
    assert files.cat(f"{name}/results/tables/maps/log=run/maps.parquet") != kept
    assert not [path for path in files.find(f"{name}/results") if "back_projected" in path or "gone" in path]
    assert files.cat(f"{name}/results/tables/rooms.parquet") == b"of the user"


@pytest.mark.parametrize("what", ["runs", "runs/*.mcap", "runs/a.mcap"])
def test_no_bucket_is_one_line(what: str):
    """Before any work is done, where it can be known."""
    with pytest.raises(LogError, match=r"there is no bucket 'nowhere' that") as told:
        signature_of(Location(found(f"s3://nowhere/{what}")[0]))
    assert not isinstance(told.value, TransferError)
    assert "\n" not in str(told.value)


@pytest.mark.parametrize("what", ["runs", "runs/*.mcap", "runs/a.mcap"])
def test_no_credentials_is_one_line_that_tells_how_to_give_them(what: str, monkeypatch):
    """No further try would change it."""
    monkeypatch.delenv("AWS_ACCESS_KEY_ID")
    monkeypatch.delenv("AWS_SECRET_ACCESS_KEY")
    with pytest.raises(
        LogError, match=r"credentials; S3 takes them from AWS_PROFILE.*FSSPEC_S3_ANON"
    ) as told:
        signature_of(Location(found(f"s3://nowhere/{what}")[0]))
    assert not isinstance(told.value, TransferError)


def test_an_object_that_is_not_there_is_one_line(bucket):
    """It names the object."""
    _, name, _ = bucket
    url = f"s3://{name}/runs/nothing.mcap"
    with pytest.raises(LogError, match=f"{url}: there is no such file or folder"):
        signature_of(Location(url))
