"""TERM and HUP end a command as Ctrl-C does: no process, no file and no warning stays."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from urllib.parse import parse_qs, urlsplit

import pytest
from commands import ROSE2_LOGS, WAIT_S, below, is_running, started, wait_for
from saved_maps import held_at, save_run

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs signals of POSIX")
SIGNALS = [signal.SIGTERM, signal.SIGHUP]
IDLE_S, IDLE_MOST_SHARE = 5.0, 0.05
"""Time that a viewer is watched for, and the share of a processor that it may use meanwhile."""


@pytest.fixture
def temporary() -> Iterator[Path]:
    """The folder for temporary files, which is to be empty again; names of sockets in it must be short."""
    with TemporaryDirectory() as folder:
        yield Path(folder)


@pytest.fixture(scope="module")
def many_maps(tmp_path_factory) -> Path:
    return save_run(tmp_path_factory.mktemp("many") / "maps", tuple(range(100, 130)))


def stop(process: subprocess.Popen[str], number: int, to_group: bool = False) -> tuple[str, str]:
    """Send a signal; all that the process started ends with it."""
    children = below(process.pid)
    if to_group:  # as when a terminal closes
        os.killpg(process.pid, number)
    else:
        process.send_signal(number)
    out, err = process.communicate(timeout=WAIT_S)
    wait_for(lambda: not any(map(is_running, children)))
    return out, err


def shared_memory() -> set[str]:
    """Names of the blocks of this project; other runs on the machine may have some, too."""
    return {path.name for path in Path("/dev/shm").glob("rose2_logs*")}


@pytest.mark.parametrize("to_group", [False, True], ids=["to the command", "to all of its group"])
@pytest.mark.parametrize("number", SIGNALS)
@pytest.mark.parametrize("command", ["analyze", "batch"])
def test_a_run_leaves_nothing_behind(
    many_maps: Path, tmp_path: Path, temporary: Path, command: str, number: int, to_group: bool
):
    """But the journal, by which it can be resumed; one line and the exit code of shells."""
    out, before = tmp_path / "out", shared_memory()
    arguments = [command, many_maps, "-o", out, "--workers", "2", "--no-rrd"]
    environment = os.environ | {"TMPDIR": str(temporary)}
    with held_at(many_maps, 20), started(*ROSE2_LOGS, *arguments, env=environment) as process:
        wait_for(lambda: list(out.rglob("*.part")))
        _, err = stop(process, number, to_group)
    lines = [line for line in err.splitlines() if line.strip()]
    assert process.returncode == 128 + number, err
    assert lines[-1] == "error: interrupted; unfinished results were removed"
    assert not [line for line in lines if re.search("semaphore|Traceback|leaked|killed", line)]
    assert list(temporary.iterdir()) == []
    new = shared_memory() - before  # what is of another run goes with it; what was left behind stays
    wait_for(lambda: not new & shared_memory())
    assert not list(out.rglob("summary.json"))


@pytest.fixture(scope="module")
def recording(tmp_path_factory) -> Path:
    from rose2_logs.workflows.analyze import RunOptions, analyze_log

    folder = tmp_path_factory.mktemp("recording")
    options = RunOptions(annotated_log=False)
    return analyze_log(save_run(folder / "maps"), folder / "results" / "maps", options).folder


def without_a_screen(temporary: Path) -> dict[str, str]:
    kept = {name: value for name, value in os.environ.items() if "DISPLAY" not in name}
    return kept | {"TMPDIR": str(temporary)}


VIEWERS = {
    "view": lambda folder: ["view", folder, "--web"],
    "serve": lambda folder: ["serve", folder.parent, "--port", "0"],
}


@pytest.mark.parametrize("number", [signal.SIGINT, *SIGNALS])
@pytest.mark.parametrize("name", VIEWERS)
def test_a_viewer_ends_with_what_it_started(recording: Path, temporary: Path, name: str, number: int):
    command = [*ROSE2_LOGS, *VIEWERS[name](recording)]
    with started(*command, env=without_a_screen(temporary)) as process:
        assert process.stdout is not None
        assert "http://" in process.stdout.readline()
        _, err = stop(process, number)
    assert (process.returncode, err) == (0, "")
    assert list(temporary.iterdir()) == []


def cpu_s(pid: int) -> float:
    """Processor time of a process."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def status(url: str, host: str | None = None) -> int:
    request = urllib.request.Request(url, headers={} if host is None else {"Host": host})
    try:
        with urllib.request.urlopen(request, timeout=WAIT_S) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as refused:
        return refused.code


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc")
def test_the_web_viewer_is_idle_and_answers_its_own_page_only(recording: Path, temporary: Path):
    """It used to keep a processor busy, and to answer whatever host a page's name led to this machine."""
    with started(*ROSE2_LOGS, "view", recording, "--web", env=without_a_screen(temporary)) as process:
        assert process.stdout is not None
        page = process.stdout.readline().split()[0]
        (source,) = parse_qs(urlsplit(page).query)["url"]
        whole = next(recording.glob("*.rrd")).read_bytes()
        with urllib.request.urlopen(source, timeout=WAIT_S) as answer:
            assert answer.read() == whole
            allowed = answer.headers["Access-Control-Allow-Origin"]
        assert page.startswith(f"{allowed}/?url=")
        port = urlsplit(source).port
        assert status(source, f"localhost:{port}") == status(source, f"[::1]:{port}") == 200
        assert status(source, f"rebound.example:{port}") == 403
        assert status(f"http://127.0.0.1:{port}/{Path(source).name}") == 404
        watched = [process.pid, *below(process.pid)]
        assert len(watched) > 1
        time.sleep(1)
        used = sum(map(cpu_s, watched))
        time.sleep(IDLE_S)
        assert sum(map(cpu_s, watched)) - used < IDLE_MOST_SHARE * IDLE_S
        stop(process, signal.SIGINT)


def test_serve_answers_its_own_names_only(recording: Path, temporary: Path):
    with started(*ROSE2_LOGS, *VIEWERS["serve"](recording), env=without_a_screen(temporary)) as process:
        assert process.stdout is not None
        (port,) = re.findall(r"rerun\+http://127\.0\.0\.1:(\d+);", process.stdout.readline())
        url = f"http://127.0.0.1:{port}/"
        assert status(url) != 403
        assert status(url, f"localhost:{port}") != 403
        assert status(url, f"rebound.example:{port}") == 403
        stop(process, signal.SIGINT)


def test_a_viewer_that_a_failed_run_started_ends_with_it(tmp_path: Path, monkeypatch):
    """One that was open before stays."""
    from looking import free_port

    import rose2_logs as rl
    from rose2_logs.outputs.rerun import viewer

    port = free_port()
    listen = f"import socket, time; s = socket.create_server(('127.0.0.1', {port})); time.sleep(600)"
    monkeypatch.setattr(viewer, "RERUN", (sys.executable, "-c", listen))
    monkeypatch.setattr(viewer, "VIEWER_PORT", port)
    monkeypatch.setattr(viewer, "VIEWER_SETTLE_S", 0.1)

    class Failing(rl.Sink):
        def begin(self, info: object) -> None:
            pass

        def write(self, step: object) -> None:
            assert viewer.listens(port)
            raise rl.OutputError("nothing more can be written")

    with pytest.raises(rl.OutputError, match="nothing more"):
        rl.analyze(
            save_run(tmp_path / "maps"), tmp_path / "out", sinks=[Failing()], live=True, recording=False
        )
    wait_for(lambda: not viewer.listens(port))
