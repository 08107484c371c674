"""Imports point one way, formats and viewers stay in their rooms, files stay readable."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "rose2_logs"

ORDER = (
    "__init__",
    "errors",
    "warning_log",
    "circular_peaks",
    "files",
    "packed",
    "workers",
    "parameter_fields",
    "baseline_parameters",
    "parameters",
    "occupancy",
    "explored",
    "rooms",
    "readers",
    "rose",
    "walls",
    "floor_plan",
    "topology",
    "baselines",
    "pipeline",
    "room_quality",
    "room_plan",
    "codec",
    "journal",
    "tracking",
    "evaluation",
    "layouts",
    "sinks",
    "drawing",
    "exports",
    "log_facts",
    "static_map",
    "provenance",
    "output_folder",
    "run_options",
    "tracked_stream",
    "run",
    "results",
    "report",
    "comparing",
    "batch",
    "reporting_messages",
    "reporting",
    "reporting_batch",
    "reporting_compare",
    "cli_messages",
    "cli_options",
    "cli_batch",
    "cli_results",
    "cli_compare",
    "cli",
    "__main__",
)
"""Lowest first. A part may import itself and what stands before it."""

ALGORITHM = ("rose", "walls", "floor_plan", "topology", "baselines", "pipeline")
ONLY_IN = {
    "rosbags": ("readers/", "sinks/annotated_mcap", "sinks/mcap", "sinks/ros"),
    "mcap": ("readers/", "sinks/annotated_mcap", "sinks/mcap", "sinks/ros"),
    "rerun": ("sinks/rerun",),
    "typer": ("cli",),
    "rich": ("reporting",),
    "distributed": ("batch/dask_workers",),
    "fsspec": ("batch/remote",),
    "ezdxf": ("exports/dxf",),
    "jinja2": ("report/",),
}
"""Libraries of formats and surfaces, and the beginnings of the files that may import them."""

MOST_LINES = 400

FILES = sorted(PACKAGE.rglob("*.py"))


def part_of(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imports(path: Path) -> set[str]:
    """Full names of the modules that a file imports anywhere, also within functions."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path} imports relatively"
            module = node.module or ""
            found |= (
                {f"{module}.{alias.name}" for alias in node.names} if module == "rose2_logs" else {module}
            )
    return found


def imported_parts(path: Path) -> set[str]:
    """Parts of this package that a file imports; ``from rose2_logs import __version__`` is of the root."""
    names = {name.split(".")[1] for name in imports(path) if name.startswith("rose2_logs.")}
    return {name if name in ORDER else "__init__" for name in names}


def test_every_part_has_its_place_in_the_order():
    """A new part must be put into the order before it can be imported."""
    assert {part_of(path) for path in FILES} <= set(ORDER)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.relative_to(PACKAGE).as_posix())
def test_imports_point_one_way(path: Path):
    """No part imports one that stands above it."""
    place = ORDER.index(part_of(path))
    above = {part for part in imported_parts(path) if ORDER.index(part) > place}
    assert not above


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.relative_to(PACKAGE).as_posix())
def test_libraries_of_formats_and_surfaces_stay_in_their_rooms(path: Path):
    """Only readers and the MCAP sink know logs, only the Rerun sink knows Rerun, only the surface prints."""
    name = path.relative_to(PACKAGE).as_posix()
    roots = {module.split(".")[0] for module in imports(path)}
    for library, allowed in ONLY_IN.items():
        assert library not in roots or name.startswith(allowed), f"{name} imports {library}"


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.relative_to(PACKAGE).as_posix())
def test_only_the_surface_prints(path: Path):
    """No print and no sys.exit outside the command line."""
    if part_of(path) in ("cli", "reporting", "__main__"):
        return
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call):
            assert ast.unparse(node.func) not in ("print", "sys.exit", "exit"), f"{path}:{node.lineno}"


def test_the_algorithm_knows_no_reader():
    """The stages see snapshots and parameters, never a log."""
    for path in FILES:
        if part_of(path) in ALGORITHM:
            assert not imported_parts(path) & {"readers", "sinks", "tracking", "workers"}, path


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.relative_to(PACKAGE).as_posix())
def test_files_stay_readable(path: Path):
    """No file grows past what can be read in one go, and each says in its first line what it is."""
    text = path.read_text(encoding="utf-8")
    assert text.count("\n") <= MOST_LINES
    assert ast.get_docstring(ast.parse(text)), f"{path} has no docstring"
