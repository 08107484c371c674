"""The examples that people copy: in docstrings, the README, the notes on the API, and the notebook."""

from __future__ import annotations

import doctest
import importlib
import json
import re
import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer
from PIL import Image
from run_notebook import run_notebook, tidy

import rose2_logs as rl

PROJECT = Path(__file__).parents[1]
NOTEBOOK = PROJECT / "docs" / "notebooks" / "tour.ipynb"
NOTEBOOK_MAX_BYTES = 400_000
WITH_EXAMPLES = sorted(
    ".".join(path.relative_to(PROJECT).with_suffix("").parts)
    for path in (PROJECT / "rose2_logs").rglob("*.py")
    if ">>> " in path.read_text(encoding="utf-8")
)
NOTES = """\
run = rl.analyze("run.mcap", out="results/run", workers=2)
run.rooms.query("in_last_map")
run[-1].plot()
for step in rl.track(rl.open_log("run.mcap")):
    print(step.coverage, step.track_ids, step.rooms.areas_m2)
rooms = rl.segment(grid, resolution_m=0.05)
rooms = rl.segment("map.yaml", method="voronoi", parameters={"walls.extension_m": 6})
rl.load("results/run").figure(coverage=0.5).save("half.svg")
rl.compare("results/monday", "results/friday").walls
"""


@pytest.fixture
def in_a_folder(tmp_path: Path, monkeypatch) -> Path:
    """A folder to work in, with the sample logs; pictures open no window."""
    (tmp_path / "sample_logs").symlink_to(PROJECT / "sample_logs")
    monkeypatch.chdir(tmp_path)
    mpl.use("Agg")
    return tmp_path


@pytest.mark.parametrize("module", WITH_EXAMPLES)
def test_examples_in_docstrings_print_what_they_say(in_a_folder: Path, module: str):
    found = doctest.testmod(importlib.import_module(module), optionflags=doctest.ELLIPSIS)
    assert found.attempted > 0
    assert found.failed == 0


def test_the_main_functions_and_classes_have_examples():
    assert {"rose2_logs.api", "rose2_logs.runs.run", "rose2_logs.runs.table", "rose2_logs.runs.sink"} <= set(
        WITH_EXAMPLES
    )


def readme_block() -> str:
    """The README's only block of Python."""
    (block,) = re.findall(r"```python\n(.*?)```", (PROJECT / "README.md").read_text("utf-8"), re.DOTALL)
    return str(block)


def test_the_python_in_the_readme_runs_as_it_stands(in_a_folder: Path, office_results: Path):
    """After its first command, which makes the results."""
    (in_a_folder / "results").mkdir()
    (in_a_folder / "results" / "office").symlink_to(office_results)
    exec(readme_block(), {})
    assert (in_a_folder / "half.svg").stat().st_size > 1000


def test_the_python_in_the_readme_needs_pandas_only_where_it_says_so(
    in_a_folder: Path, office_results: Path, monkeypatch
):
    """Up to the comment that names pandas and matplotlib, it runs without them."""
    (in_a_folder / "results").mkdir()
    (in_a_folder / "results" / "office").symlink_to(office_results)
    for package in ("pandas", "matplotlib", "matplotlib.pyplot"):
        monkeypatch.setitem(sys.modules, package, None)
    plain, comment, rest = readme_block().partition("# Only what follows needs pandas and matplotlib")
    names: dict[str, object] = {}
    exec(plain, names)
    assert comment
    with pytest.raises(rl.MissingPackageError):
        exec(rest.partition("\n")[2], names)


def thin_out(log: Path, to: Path) -> None:
    """Copy every 13th map of a log."""
    with log.open("rb") as source, to.open("wb") as target:
        writer = Writer(target)
        writer.start("ros2")
        maps = list(make_reader(source).iter_messages(topics=["/map"]))
        schema, channel, _ = maps[0]
        schema_id = writer.register_schema(schema.name, schema.encoding, schema.data)
        channel_id = writer.register_channel("/map", channel.message_encoding, schema_id, channel.metadata)
        for _, _, message in maps[::13]:
            writer.add_message(channel_id, message.log_time, message.data, message.publish_time)
        writer.finish()


def test_ten_lines_say_what_the_api_is(in_a_folder: Path):
    thin_out(PROJECT / "sample_logs" / "office.mcap", in_a_folder / "run.mcap")
    first = rl.analyze(
        "run.mcap", out="results/monday", max_snapshots=2, recording=False, annotated_log=False
    )
    (in_a_folder / "results" / "friday").symlink_to(first.folder.resolve())
    pixels = np.flipud(np.choose(1 + np.sign(first[-1].cells), [205, 254, 0])).astype(np.uint8)
    Image.fromarray(pixels).save("map.png")
    (in_a_folder / "map.yaml").write_text("image: map.png\nresolution: 0.05\norigin: [0, 0, 0]\n")
    names: dict[str, object] = {"rl": rl, "grid": first[-1].cells}
    exec(NOTES, names)
    assert len(names["rooms"].rooms) > 5
    assert (in_a_folder / "half.svg").stat().st_size > 1000


def test_the_notebook_runs_and_its_outputs_are_stored(in_a_folder: Path):
    """Each cell without an error; what is stored has the same outputs, is tidy and small."""
    stored = json.loads(NOTEBOOK.read_text(encoding="utf-8"))
    assert NOTEBOOK.stat().st_size < NOTEBOOK_MAX_BYTES
    assert stored["metadata"]["language_info"] == {"name": "python"}
    found = run_notebook(NOTEBOOK)
    tidy(found)
    for old, new in zip(stored["cells"], found.cells, strict=True):
        assert [_kinds(output) for output in old.get("outputs", [])] == [
            _kinds(output) for output in new.get("outputs", [])
        ], new.source
        for one, other in zip(old.get("outputs", []), new.get("outputs", []), strict=True):
            if one["output_type"] == "stream":
                assert "".join(one["text"]) == "".join(other["text"])


def _kinds(output) -> list[str]:
    return [output["output_type"], *sorted(output.get("data", {}))]
