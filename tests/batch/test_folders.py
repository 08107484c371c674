"""Names of logs' folders."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rose2_logs.batch.folders import LONGEST_BYTES, assign_names, safe_name
from rose2_logs.batch.location import Location


def names_of(*targets: str, known: dict[str, str] | None = None, taken: tuple[str, ...] = ()) -> list[str]:
    named = assign_names([Location(target) for target in targets], known or {}, taken)
    return [named[Location(target)] for target in targets]


@given(st.text())
def test_a_name_is_one_harmless_part_of_a_path(text: str):
    """Never empty, hidden, a way up or down, too long, or a number to the readers of a data set."""
    name = safe_name(text)
    assert name
    assert name[0] not in "._"
    assert not set(name) & set('/\\:*?"<>|%= \n\0')
    assert len(name.encode()) <= LONGEST_BYTES + len("log_")
    with pytest.raises(ValueError, match="could not convert"):
        float(name)
    assert safe_name(name) == name


@given(st.sets(st.from_regex(r"/([ab.]/){0,2}(run|Run|7)(\.mcap|\.bag)?", fullmatch=True), min_size=1))
def test_every_log_has_a_name_of_its_own_whatever_the_order(targets: set[str]):
    """Also on file systems that do not tell upper from lower case."""
    forward = dict(zip(sorted(targets), names_of(*sorted(targets)), strict=True))
    assert len({name.casefold() for name in forward.values()}) == len(targets)
    backward = sorted(targets, reverse=True)
    assert dict(zip(backward, names_of(*backward), strict=True)) == forward


@given(
    st.sets(st.from_regex(r"/([ab.]/){0,2}(run|a_run)(\.mcap|\.bag)?", fullmatch=True), min_size=2), st.data()
)
def test_a_batch_that_is_resumed_names_the_rest_as_it_would_have(targets: set[str], data: st.DataObject):
    """Whichever of the logs have their names already."""
    names = dict(zip(sorted(targets), names_of(*sorted(targets)), strict=True))
    done = data.draw(st.sets(st.sampled_from(sorted(targets))))
    known = {log: names[log] for log in done}
    assert names_of(*sorted(targets), known=known) == list(names.values())


def test_names_are_those_of_the_logs_and_as_much_of_their_folders_as_it_takes():
    """The common case stays short."""
    assert names_of("/data/run.mcap", "/data/other.bag") == ["run", "other"]
    assert names_of("/data/r1/run.mcap", "/data/r2/run.bag", "/data/x.bag") == ["r1_run", "r2_run", "x"]
    assert names_of("/d/a/s/run.mcap", "/d/b/s/run.mcap") == ["a_s_run", "b_s_run"]
    assert names_of("s3://bucket/r1/run.mcap", "https://host/r2/my%20run.mcap") == ["run", "my_run"]


def test_one_name_in_two_formats_needs_a_hash():
    """The same folders, the same stem."""
    one, other = names_of("/data/run.mcap", "/data/run.bag")
    assert one != other
    assert one.startswith("run-")
    assert other.startswith("run-")


def test_logs_keep_their_names_when_others_join():
    """The one that has a name keeps it; folders that are nobody's are left alone."""
    known = {"/data/r1/run.mcap": "run"}
    assert names_of("/data/r1/run.mcap", "/data/r2/run.mcap", known=known) == ["run", "r2_run"]
    assert names_of("/data/r2/run.mcap", known=known) == ["r2_run"]
    assert names_of("/data/r2/run.mcap", taken=("RUN",)) == ["r2_run"]


@pytest.mark.parametrize("text", ["007", "2024-05-01-10-11-12", "1e5", "nan", "NULL", "..", "/"])
def test_names_that_readers_would_take_for_values_get_a_prefix(text: str):
    """A partition ``log=007`` would be read as the number 7."""
    assert safe_name(text).startswith("log")
