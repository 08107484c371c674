"""Logs in an object store: a real server that speaks S3, on this machine."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest
from batches import Heard, finish, make_logs, run_batch, started_batch, summary, table_bytes, worker_of
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
