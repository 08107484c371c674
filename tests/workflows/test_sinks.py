"""Outputs of one's own: what is called when, and that a run which fails leaves nothing of any output."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from saved_maps import save_run

import rose2_logs as rl
from rose2_logs.errors import OutputError
from rose2_logs.outputs.mcap.annotated import AnnotatedMcap

MAPS = 3


class Told(rl.Sink):
    """Writes a line to a file for each call; fails at one of them if asked to."""

    def __init__(self, path: Path, fail_at: str = "", error: BaseException | None = None) -> None:
        self.calls: list[str] = []
        self.path = path
        self._fail_at, self._error = fail_at, error

    def _call(self, name: str) -> None:
        self.calls.append(name)
        if name == self._fail_at and self._error is not None:
            raise self._error
        with self.path.open("a") as file:
            file.write(f"{name}\n")

    def begin(self, info: rl.RunInfo) -> None:
        self.info = info
        self._call("begin")

    def write(self, step: rl.TrackedSnapshot) -> None:
        self._call(f"write {step.snapshot.index}")

    def write_back_projected(self, found) -> None:
        self._call(f"back {found.snapshot.index}")

    def finish(self, summary: rl.RunSummary) -> None:
        self.summary = summary
        self._call("finish")
        self.facts = {"calls": len(self.calls)}

    def abandon(self) -> None:
        self.calls.append("abandon")
        self.path.unlink(missing_ok=True)


@pytest.fixture(scope="module")
def log(tmp_path_factory) -> Path:
    return save_run(tmp_path_factory.mktemp("log") / "maps")


WRITES = [f"write {number}" for number in range(MAPS)]


def test_a_sink_is_told_of_the_run_of_each_map_and_of_the_end(log: Path, tmp_path: Path):
    sink = Told(tmp_path / "told")
    run = rl.analyze(log, tmp_path / "out", sinks=[sink], annotated_log=False, recording=False)
    assert sink.calls == ["begin", *WRITES, "finish"]
    assert (sink.info.log_path, sink.info.topic, sink.info.method) == (log, "/map", "rose2")
    assert sink.info.parameters == rl.Parameters()
    assert sink.summary.totals.snapshots == MAPS
    assert sink.summary.layout_final.snapshot == run.summary["layout"]["final_since"]["snapshot"]


def test_what_is_projected_back_comes_after_all_maps(log: Path, tmp_path: Path):
    sink = Told(tmp_path / "told")
    rl.analyze(log, sinks=[sink], back_project=True)
    assert sink.calls == ["begin", *WRITES, *(f"back {number}" for number in range(MAPS)), "finish"]


def test_facts_stand_in_the_summary(log: Path, tmp_path: Path):
    """As they are after the end."""
    run = rl.analyze(log, tmp_path / "out", sinks=[Told(tmp_path / "told")], recording=False)
    assert run.summary["calls"] == MAPS + 2
    assert {"calls", "annotated_log"} < json.loads((run.folder / "summary.json").read_text()).keys()


def test_a_sink_needs_no_more_than_write(log: Path):
    class Counter(rl.Sink):
        count = 0

        def write(self, step: rl.TrackedSnapshot) -> None:
            self.count += 1

    sink = Counter()
    rl.analyze(log, sinks=[sink])
    assert sink.count == MAPS
    with pytest.raises(rl.ParameterError, match="no method write"):
        rl.analyze(log, sinks=[rl.Sink()])


def test_further_sinks_come_first_in_their_order(log: Path, tmp_path: Path):
    """So that what one of them refuses is not written by others."""
    one, two = (Told(tmp_path / "told") for _ in range(2))
    rl.analyze(log, sinks=[one, two])
    lines = (tmp_path / "told").read_text().splitlines()
    assert lines == [call for call in one.calls for _ in range(2)]


def names(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


@pytest.mark.parametrize("error", [ValueError("broken"), KeyboardInterrupt()], ids=["error", "Ctrl-C"])
@pytest.mark.parametrize("place", [0, 1], ids=["first", "second"])
@pytest.mark.parametrize("fail_at", ["begin", "write 0", "write 2", "back 1", "finish"])
def test_if_a_sink_fails_nothing_of_any_output_stays(
    log: Path, tmp_path: Path, fail_at: str, place: int, error: BaseException
):
    """All sinks are abandoned once, also those that were not begun; recording and annotated MCAP go too."""
    out = tmp_path / "out"
    failing = Told(tmp_path / "failing", fail_at, error)
    other = Told(tmp_path / "other")
    sinks = [failing, other] if place == 0 else [other, failing]
    with pytest.raises(type(error)):
        rl.analyze(log, out, sinks=sinks, back_project=True, journal=False, layers=())
    assert failing.calls[-2:] == [fail_at, "abandon"]
    assert other.calls[-1] == "abandon"
    assert [sink.calls.count("abandon") for sink in sinks] == [1, 1]
    assert (fail_at in other.calls) == (place == 1)
    assert names(tmp_path) == []


def test_a_sink_that_fails_costs_nothing_of_earlier_results(log: Path, tmp_path: Path):
    out = tmp_path / "out"
    options = {"recording": False, "annotated_log": False, "journal": False}
    rl.analyze(log, out, **options)
    before = {file.name: file.read_bytes() for file in out.iterdir()}
    sink = Told(tmp_path / "told", "finish", ValueError("broken"))
    with pytest.raises(ValueError, match="broken"):
        rl.analyze(log, out, sinks=[sink], overwrite=True, **options)
    assert {file.name: file.read_bytes() for file in out.iterdir()} == before


@pytest.mark.parametrize("method", ["begin", "write", "finish"])
def test_if_an_output_of_the_package_fails_sinks_of_ones_own_are_abandoned(
    log: Path, tmp_path: Path, monkeypatch, method: str
):
    def fail(*_: object) -> None:
        raise OutputError("the disk is full")

    monkeypatch.setattr(AnnotatedMcap, method, fail)
    sink = Told(tmp_path / "told")
    with pytest.raises(OutputError, match="the disk is full"):
        rl.analyze(log, tmp_path / "out", sinks=[sink], journal=False, layers=())
    assert sink.calls[-1] == "abandon"
    assert ("finish" in sink.calls) == (method == "finish")
    assert names(tmp_path) == []


def test_a_sink_that_fails_to_leave_does_not_keep_the_others_from_it(log: Path, tmp_path: Path):
    class Stubborn(Told):
        def abandon(self) -> None:
            super().abandon()
            raise OSError("stuck")

    first, stubborn = Told(tmp_path / "first"), Stubborn(tmp_path / "stubborn")
    failing = Told(tmp_path / "failing", "write 1", ValueError("broken"))
    with pytest.raises(OSError, match="stuck") as error:
        rl.analyze(log, tmp_path / "out", sinks=[first, stubborn, failing], journal=False)
    assert isinstance(error.value.__context__, ValueError)
    assert first.calls[-1] == "abandon"
    assert names(tmp_path) == []


def test_sinks_are_not_called_if_the_run_cannot_begin(log: Path, tmp_path: Path):
    sink = Told(tmp_path / "told")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "summary.json").write_text("{}")
    with pytest.raises(OutputError, match="already exists"):
        rl.analyze(log, tmp_path / "out", sinks=[sink])
    assert sink.calls == []


@pytest.mark.parametrize("facts", [{"results": {}}, {"mine": {1, 2}}])
def test_facts_that_the_summary_cannot_hold_are_one_line(log: Path, tmp_path: Path, facts):
    """A name that it has itself, and values that are not JSON; no folder is made."""

    class Fact(rl.Sink):
        def write(self, step: rl.TrackedSnapshot) -> None:
            self.facts = facts

    with pytest.raises(OutputError, match=r"summary\.json"):
        rl.analyze(log, tmp_path / "out", sinks=[Fact()], recording=False, annotated_log=False)
    assert not (tmp_path / "out").exists()
